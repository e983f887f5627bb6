"""The response of a signal to a sudden event: a curve, and damped modes that it excites.

A key bends and heaves, its jack stands on cloth, the transducer resonates: what the laser and the
transducer show of a release is the step of the string's force, convolved with the response of all
these. It is a sum of exponentials exp(p t) with poles p, which are found together with the instant
of the event. All these have inertia, so that neither the signals nor their slopes jump.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sautereau.trajectory.motion import Floats

Poles = NDArray[np.complex128]

SCALE = 1e-2
"""s, after which a curve of coefficient 1 has reached 1."""


def pole(frequency: float, damping: float) -> complex:
    """Return the pole of a mode [1/s] with this frequency [Hz] and damping ratio."""
    turn = 2 * math.pi * frequency
    return complex(-damping * turn, turn * math.sqrt(max(0.0, 1 - damping**2)))


@dataclass(frozen=True)
class Response:
    """Means over blocks of a stretch of signal, of what happens in it."""

    time: Floats
    """s, middles of the blocks, shape (n,)."""
    step: float
    """s, length of a block."""

    @cached_property
    def _ends(self) -> Floats:
        """s, of the blocks, shape (n + 1,)."""
        return np.append(self.time - self.step / 2, self.time[-1] + self.step / 2)

    def _since(self, instants: Floats) -> Floats:
        """Return the times of the blocks' ends after each instant [s], shape (..., n + 1)."""
        return np.maximum(self._ends - instants[..., None], 0.0)

    def _waves(self, instants: Floats, poles: Poles) -> Poles:
        """Return exp(p t) at these times t, shape (..., n + 1, modes).

        It is a product, as exponentials take most of the time of many instants and poles.
        """
        start = np.exp(-instants[..., None, None] * poles)
        later = (self._ends > instants[..., None])[..., None]
        return np.where(later, np.exp(self._ends[:, None] * poles) * start, 1.0)

    def before(self, poles: Poles) -> Floats:
        """Return a parabola, and ringing from before; shape (n, 3 + 2 modes)."""
        u = self.time[:, None] / SCALE
        waves = np.exp((self.time - self.time[0])[:, None] * poles)
        return np.concatenate([u**0, u, u**2, _pairs(waves)], 1)

    def event(self, instants: Floats, poles: Poles) -> Floats:
        """Return the curve and the modes from each instant on.

        A mode is exp(p t) - 1 - p t, of which a column holds the real, another the imaginary part.

        Args:
            instants: s, any shape.
            poles: 1/s, shape (modes,).

        Returns:
            Shape (..., n, 1 + 2 modes).
        """
        t = self._since(instants)[..., None]
        waves = (self._waves(instants, poles) - 1) / poles - t * (1 + poles / 2 * t)
        curve = t**3 / (3 * SCALE**2)
        return np.diff(np.concatenate([curve, _pairs(waves)], -1), axis=-2) / self.step

    def slopes(self, instants: Floats, poles: Poles) -> tuple[Floats, Poles, Poles]:
        """Return the derivatives of the columns of events, and of ringing from before.

        Args:
            instants: s, shape (events,).
            poles: 1/s, shape (modes,).

        Returns:
            Of each event by its instant, shape (events, n, 1 + 2 modes); of its complex modes
            by their poles, shape (events, n, modes); of those from before, shape (n, modes).
        """
        t = self._since(instants)[..., None]
        waves = self._waves(instants, poles)
        curve = t**2 / SCALE**2
        by_instant = np.concatenate([curve, _pairs(waves - 1 - poles * t)], -1)
        by_pole = (t * waves - (waves - 1) / poles) / poles - t**2 / 2
        early = (self.time - self.time[0])[:, None]
        return (
            -np.diff(by_instant, axis=-2) / self.step,
            np.diff(by_pole, axis=-2) / self.step,
            early * np.exp(early * poles),
        )


def _pairs(waves: Poles) -> Floats:
    """Return real and imaginary parts side by side, shape (..., 2 modes)."""
    return np.concatenate([waves.real, waves.imag], -1)
