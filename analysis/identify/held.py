"""The force of a string that a jack holds: the quasi-static pluck, and the string's vibration.

A string of the static flexibility 1 / K follows the force N of a slow jack by N / K. The force of a
faster one excites its modes. Let w be the displacement of the string, and d = N / K - w how far it
is behind. The plectrum is then bent as in a quasi-static pluck at the height h + d of the jack. The
modes n at the plucking point have the shapes s_n and the masses m, and obey

    m (q_n'' + w_n^2 q_n) = s_n N,    d = sum of s_n (s_n N / (m w_n^2) - q_n).

N depends on d itself. The mean slope of N over h is part of the modes that are computed, those of
the string on the plectrum; the remainder is found by iteration.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.identify.elastic import oscillation
from sautereau.analysis.identify.parameter_names import OUTWARD, VIBRATION
from sautereau.analysis.model.choirs import choir_pluck
from sautereau.analysis.model.pluck.pluck import Pluck
from sautereau.analysis.model.string.string import ModalString
from sautereau.rig.instrument import Choir
from sautereau.trajectory.motion import Floats

HIGHEST = 1500.0
"""Highest frequency of the strings' modes (Hz). The smoothing removes faster vibrations."""


@dataclass(frozen=True)
class HeldString:
    """The force of a string on its jack."""

    pluck: Pluck
    """The quasi-static pluck."""
    outward: Pluck | None
    """The same if the friction always points to the tip; None without friction."""
    share: float
    """Fraction of `outward` in the force."""
    vibration: float
    """Vibration of the string divided by that of an undamped string."""
    slope: float
    """N/m, mean slope of the force on the height, times `vibration`."""
    flexibility: float
    """m/N, static flexibility of the modes."""
    modes: tuple[tuple[float, float], ...]
    """Frequency [Hz] and flexibility [m/N] of the modes of the string on the plectrum."""

    def force(self, height: Floats, behind: Floats) -> Floats:
        """Return the downward force [N] on a jack.

        Args:
            height: m, of the jack above first contact, shape (n,).
            behind: m, `behind` for the force of the previous iteration, shape (n,).
        """
        height = np.minimum(height + behind, self.pluck.release_height)
        force = self.pluck.force_on_jack(height)
        if self.outward is None:
            return force
        return force + self.share * (self.outward.force_on_jack(height) - force)

    def behind(self, force: Floats, before: Floats, step: float) -> Floats:
        """Return how far the string is behind its static displacement [m], shape (n,).

        Args:
            force: N, on the string at rest before, shape (n,).
            before: m, the result for the force of the previous iteration, shape (n,).
            step: s, time between values.
        """
        if not self.vibration:
            return np.zeros_like(force)
        free = 1 - self.slope * self.flexibility
        push = (force - self.slope * before / self.vibration) / free
        found = self.flexibility * push
        for frequency, flexibility in self.modes:
            found -= flexibility / free * oscillation(push, frequency, 0.0, step)[0]
        return self.vibration * found


def held_string(choir: Choir, pluck: Pluck, level: str, values: Mapping[str, float]) -> HeldString:
    """Return the held string of a choir.

    Args:
        choir: The choir.
        pluck: Its pluck.
        level: Plectrum model.
        values: Values of the parameters, by name.
    """
    share, vibration = values.get(OUTWARD, 0.0), values.get(VIBRATION, 0.0)
    rubs = share > 0 and choir.plectrum.friction > 0
    string = ModalString(choir.string, max(1, round(HIGHEST / choir.string.frequency)))
    flexibility = float(np.sum(string.shape**2 / (string.mass * string.omega**2)))
    slope = vibration * float(pluck.vertical_force[-1]) / pluck.release_height
    joined = slope / (1 - slope * flexibility) / string.mass
    squares, shapes = np.linalg.eigh(
        np.diag(string.omega**2) + joined * np.outer(string.shape, string.shape)
    )
    frequencies = np.sqrt(squares) / (2 * np.pi)
    own = (string.shape @ shapes) ** 2 / (string.mass * squares)
    return HeldString(
        pluck,
        choir_pluck(choir, level, sticks=False) if rubs else None,
        share,
        vibration,
        slope,
        flexibility,
        tuple(zip(frequencies.tolist(), own.tolist(), strict=True)),
    )
