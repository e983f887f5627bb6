"""The response of the load to a sudden event: a step, a bend, and damped modes that it excites.

A key bends and heaves, its jack stands on cloth, the transducer resonates: what the laser and the
transducer show of a release is the step convolved with the response of all these. It is a sum of
exponentials exp(p t) with poles p, which are found together with the instant of the event.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.phases.signals import Rows
from sautereau.trajectory.motion import Floats

Poles = NDArray[np.complex128]

BEND_TIME = 1e-2
"""s, after which a bend of coefficient 1 has changed the load by 1 N."""


def pole(frequency: float, damping: float) -> complex:
    """Return the pole of a mode [1/s] with this frequency [Hz] and damping ratio."""
    turn = 2 * math.pi * frequency
    return complex(-damping * turn, turn * math.sqrt(max(0.0, 1 - damping**2)))


class Columns:
    """Means over rows of the responses to an event at several instants.

    Args:
        rows: Of the load.
        near: s after the trigger, origin of the time of the events.
        samples: Number of samples of each block; a row has the triangular weight of two blocks,
            or for 1 the mean between two samples.
    """

    def __init__(self, rows: Rows, near: float, samples: int):
        self.time = rows.time - near
        self._step, self._single = rows.step, samples == 1
        ends = (-0.5, 0.5) if self._single else (-1.0, 1.0)
        n = len(rows.time)
        self._edges = self.time[0] + rows.step * (np.arange(n + 1 + (not self._single)) + ends[0])

    def step(self, instants: Floats) -> Floats:
        """Return a step at each instant [s], shape (instants, n)."""
        return self._mean(instants, lambda t: t, lambda t: t * t / 2)

    def bend(self, instants: Floats) -> Floats:
        """Return a bend at each instant, in units of `BEND_TIME`; shape (instants, n)."""
        found = self._mean(instants, lambda t: t * t / 2, lambda t: t * t * t / 6)
        return found / BEND_TIME

    def curve(self, instants: Floats) -> Floats:
        """Return a parabola from each instant on, 1 after `BEND_TIME`; shape (instants, n)."""
        found = self._mean(instants, lambda t: t**3 / 3, lambda t: t**4 / 12)
        return found / BEND_TIME**2

    def ring(self, instants: Floats, p: complex) -> Poles:
        """Return exp(p t) from each instant on, shape (instants, n)."""
        return self._mean(
            instants,
            lambda t: (np.exp(p * t) - 1) / p,
            lambda t: (np.exp(p * t) - 1 - p * t) / p**2,
        )

    def event(self, instants: Floats, poles: Poles) -> Floats:
        """Return all columns of an event, shape (instants, 3 + 2 poles, n)."""
        columns = [self.step(instants), self.bend(instants), self.curve(instants)]
        for p in poles:
            ring = self.ring(instants, p)
            columns += [ring.real, ring.imag]
        return np.stack(columns, 1)

    def _mean(
        self, instants: Floats, once: Callable[[Floats], Any], twice: Callable[[Floats], Any]
    ) -> Any:
        """Return the mean over each row of a response with these first and second integrals."""
        since = np.maximum(self._edges - instants[:, None], 0.0)
        if self._single:
            return np.diff(once(since)) / self._step
        return np.diff(twice(since), 2) / self._step**2
