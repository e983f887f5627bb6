"""The mid-line of a bent plectrum from clamp to tip, for plots."""

import numpy as np

from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.elastica import Elastica
from sautereau.rig.instrument import Plectrum

POINTS = 24
"""Points of a mid-line from the clamp to the string."""


def straight(plectrum: Plectrum) -> Floats:
    """Return the mid-line [m] of an unloaded plectrum, shape (POINTS + 1, 2)."""
    x = np.linspace(0, plectrum.length, POINTS + 1)
    return np.stack([x, np.zeros_like(x)], -1)


def mid_line(plectrum: Elastica, s: Floats, force: Floats) -> Floats:
    """Return mid-lines in the clamp's frame [m], shape (n, POINTS + 1, 2): x outwards, z up.

    The part between a section and the string is, seen from that section, a shorter plectrum
    under the same load; its contact point and tangent give the position of the section. Beyond
    the string the plectrum is straight.

    Args:
        s: m, positions of the string on it, shape (n,).
        force: N, of the string, shape (n,).

    Raises:
        ModelError: A position is not on the plectrum, or a force beyond the level's range.
    """
    contact = plectrum.bend(s, force)
    end = np.stack([contact.x, contact.z], -1)[:, None]
    arms = s[:, None] * np.linspace(1.0, 0.0, POINTS)[:-1]  # from each section to the string
    part = plectrum.bend(arms, force[:, None])
    turn = contact.theta[:, None] - part.theta
    cosine, sine = np.cos(turn), np.sin(turn)
    arm = np.stack([cosine * part.x - sine * part.z, sine * part.x + cosine * part.z], -1)
    tangent = np.stack([np.cos(contact.theta), np.sin(contact.theta)], -1)
    tip = end[:, 0] + (plectrum.length - s)[:, None] * tangent
    return np.concatenate([end - arm, end, tip[:, None]], axis=1)
