"""The force of a string that a jack holds: the quasi-static pluck, and the string's vibration.

A string of the static flexibility 1 / K follows the force N of a slow jack by N / K. The force of a
faster one excites its modes. Let w be the displacement of the string, and d = N / K - w how far it
is behind. The plectrum is then bent as in a quasi-static pluck at the height h + d of the jack. The
modes n at the plucking point have the shapes s_n and the masses m, and obey

    m (q_n'' + w_n^2 q_n) = s_n N,    d = sum of s_n (s_n N / (m w_n^2) - q_n).

N depends on d itself. The mean slope of N over h is part of the modes that are computed, those of
the string on the plectrum; the remainder is found by iteration. Their response to a force is its
convolution with a response that all presses of a string have in common.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.identify.elastic import LARGEST_STEP
from sautereau.analysis.model.pluck.pluck import Pluck
from sautereau.analysis.model.string.string import ModalString
from sautereau.rig.instrument import Choir, String
from sautereau.trajectory.motion import Floats

HIGHEST = 1500.0
"""Highest frequency of the strings' modes (Hz). The smoothing removes faster vibrations."""


@dataclass(frozen=True)
class HeldString:
    """The force of a string on its jack."""

    string: String
    pluck: Pluck
    """The quasi-static pluck."""
    vibration: float
    """Vibration of the string divided by that of an undamped string."""
    slope: float
    """N/m, mean slope of the force on the height."""

    def force(self, height: Floats, behind: Floats) -> Floats:
        """Return the downward force [N] on a jack.

        Args:
            height: m, of the jack above first contact, shape (n,).
            behind: m, `behind` for the force of the previous iteration, shape (n,).
        """
        return self.pluck.force_on_jack(np.minimum(height + behind, self.pluck.release_height))

    def behind(self, force: Floats, before: Floats, step: float) -> Floats:
        """Return how far the string is behind its static displacement [m], shape (n,).

        Args:
            force: N, on the string at rest before, shape (n,).
            before: m, the result for the force of the previous iteration, shape (n,).
            step: s, time between values.
        """
        found, push = np.zeros_like(force), force - self.slope * before
        if self.vibration and push.any():
            first = int(np.argmax(push != 0))
            count = len(push) - first
            size = 1 << count.bit_length()
            # Of the undamped string: with frequencies that depend on the vibration, each of its
            # values had a minimum of the fit's cost nearby.
            own = _response(self.string, self.slope, step, size)  # pyright: ignore
            found[first:] = np.convolve(push[first:], own[:count])[:count]
        return self.vibration * found


def held_string(choir: Choir, pluck: Pluck, vibration: float) -> HeldString:
    """Return the held string of a choir.

    Args:
        vibration: Vibration of the string divided by that of an undamped string.
    """
    slope = float(pluck.vertical_force[-1]) / pluck.release_height
    return HeldString(choir.string, pluck, vibration, slope)


@lru_cache(maxsize=32)
def _response(string: String, slope: float, step: float, count: int) -> Floats:
    """Return how far a string on a spring is behind after a force of 1 N during one step.

    A mode responds as by the bilinear transform, which is exact for slow forces and at the
    frequency of the mode.

    Args:
        slope: N/m, of the spring.
        step: s.
        count: Number of steps.

    Returns:
        m, shape (count,).

    Raises:
        ModelError: The string would vibrate more than it is displaced, and without a limit.
    """
    modal = ModalString(string, max(1, round(HIGHEST / string.frequency)))
    flexibility = float(np.sum(modal.shape**2 / (modal.mass * modal.omega**2)))
    free = 1 - slope * flexibility
    if free <= 0:
        raise ModelError(
            f"string: held by {slope:.4g} N/m it has no stable vibration; give a softer plectrum"
        )
    joined = slope / free / modal.mass * np.outer(modal.shape, modal.shape)
    squares, shapes = np.linalg.eigh(np.diag(modal.omega**2) + joined)
    own = (modal.shape @ shapes) ** 2 / (modal.mass * squares)
    turn = np.minimum(np.sqrt(squares) * step, 2 * LARGEST_STEP)
    modes = np.sin(turn)[:, None] * np.sin(np.outer(turn, np.arange(count)))
    modes[:, 0] = (1 - np.cos(turn)) / 2
    found = -(own / free) @ modes
    found[0] += flexibility
    return found / free
