"""The outline of a bent plectrum, for drawings: the elastica with EI(s), whatever the level."""

import numpy as np

from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.profile import profile_of
from sautereau.analysis.model.plectrum.tapered import step_to_clamp
from sautereau.rig.instrument import Plectrum

POINTS = 8  # Evenly spaced sections of a drawing from the clamp to the string
KINKS = 12  # Largest number of kinks of an outline at which there are further sections
STEPS = 4  # Steps of the integration between two sections


def straight(plectrum: Plectrum) -> Floats:
    """Return the outline [m] of an unloaded plectrum; see `bent`."""
    tip, none = np.array([plectrum.length]), np.zeros(1)
    return bent(plectrum, tip, none, none)[0]


def bent(plectrum: Plectrum, s: Floats, force: Floats, drag: Floats) -> Floats:
    """Return closed outlines [m] in the clamp's frame, shape (n, points, 2): x outwards, z up.

    The top comes first, from the clamp to the tip.

    Args:
        plectrum: Its shape and its stiffness.
        s: m, positions of the string on it, shape (n,).
        force: N, normal to the surface, shape (n,).
        drag: Force along the surface towards the tip over the normal one, shape (n,).
    """
    profile, length = profile_of(plectrum), plectrum.length
    place = (s / length)[:, None]
    kinks = profile.x[(profile.x > 0) & (profile.x < place.min(initial=1.0))]
    kinks = np.tile(kinks if len(kinks) <= KINKS else [], (len(s), 1))
    drawn = np.sort(np.hstack([place * np.linspace(0.0, 1.0, POINTS), kinks]), axis=1)
    count = STEPS * (drawn.shape[1] - 1)
    x = np.ones((len(s), count + 2))
    share = np.arange(count + 1) / STEPS
    low = np.minimum(share.astype(int), drawn.shape[1] - 2)
    x[:, :-1] = drawn[:, low] + (drawn[:, low + 1] - drawn[:, low]) * (share - low)
    top, bottom = profile.edges(x)
    middle, depth = (top + bottom) / 2, top - bottom
    slope = np.arctan(profile.contact_line(place[:, 0])[1])
    stiffness = plectrum.modulus * plectrum.width * length / 12
    state = np.zeros((3, len(s)))
    states = [state]
    for number in range(count, 0, -1):
        rise, run = (a[:, number] - a[:, number - 1] for a in (middle, x))
        ends = depth[:, number], depth[:, number - 1]
        flexibility = force / (stiffness * np.stack([ends[0], sum(ends) / 2, ends[1]]) ** 3)
        lean = np.arctan2(rise, run) - slope
        state = step_to_clamp(state, flexibility, np.hypot(rise, run), lean, drag)
        states.append(state)
    turned, along, across = np.stack(states[::-1], -1)
    angle, section = turned[:, :1] - slope[:, None], turned[:, :1] - turned
    # From the string to each section, against the surface under the string; then in the clamp's.
    along, across = along[:, :1] - along, across[:, :1] - across
    path = np.cos(angle) * along + np.sin(angle) * across
    rise = np.cos(angle) * across - np.sin(angle) * along
    # Beyond the string nothing bends.
    end = section[:, -1:]
    over, up = x[:, -1:] - x[:, -2:-1], middle[:, -1:] - middle[:, -2:-1]
    path = np.hstack([path, path[:, -1:] + np.cos(end) * over + np.sin(end) * up])
    rise = np.hstack([rise, rise[:, -1:] + np.cos(end) * up - np.sin(end) * over])
    section = np.hstack([section, end])
    path, rise, section, depth = (
        np.append(a[:, : count + 1 : STEPS], a[:, -1:], axis=1)
        for a in (path, rise, section, depth)
    )
    offset = depth[..., None] / 2 * np.stack([np.sin(section), np.cos(section)], -1)
    line = np.stack([path, rise], -1)
    return length * np.concatenate([line + offset, (line - offset)[:, ::-1]], axis=1)
