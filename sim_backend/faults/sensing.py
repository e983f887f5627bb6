"""What goes wrong in a sensor itself, before its filters: speckle, overload, drift."""

import math
from typing import Protocol

import numpy as np
from numpy.random import Generator

from sautereau.sim_backend.faults.tables import Drift, Faults, Overload, Speckle
from sautereau.trajectory.motion import Floats


class Disturbance(Protocol):
    """Something that changes what a sensor shows."""

    def disturb(self, times: Floats, values: Floats) -> Floats:
        """Return what is shown at times [s from the trigger]; call it in order."""
        ...


class DropOuts:
    """A vibrometer's loss of light: the velocity falls to a share, and a false one shows.

    Args:
        fault: How often, how long, how much.
        random: Of the times and the false velocities.
    """

    def __init__(self, fault: Speckle, random: Generator):
        self._fault, self._random = fault, random
        self._end = 0.0
        self._strike()

    def disturb(self, times: Floats, values: Floats) -> Floats:
        """Return what is shown [m/s] at times [s from the trigger]; call it in order."""
        values = values.copy()
        while len(times):
            first, stop = np.searchsorted(times, (self._start, self._end))
            values[first:stop] = values[first:stop] * self._fault.level + self._spike
            if stop == len(times):
                break
            self._strike()
        return values

    def _strike(self) -> None:
        """Choose the next drop-out."""
        self._start = self._end + self._random.exponential(1 / self._fault.rate)
        self._end = self._start + self._fault.duration
        self._spike = self._fault.spike * self._random.uniform(-1.0, 1.0)


class Overloading:
    """An amplifier that shows its limit as long as it is overloaded, and while it recovers.

    Args:
        fault: From which force on, and for how long.
    """

    def __init__(self, fault: Overload):
        self._fault = fault
        self._last, self._sign = -math.inf, 0.0

    def disturb(self, times: Floats, values: Floats) -> Floats:
        """Return what is shown [N] at times [s from the trigger]; call it in order."""
        limit = self._fault.force
        over = np.abs(values) >= limit
        index = np.maximum.accumulate(np.where(over, np.arange(len(values)), -1))
        last = np.where(index >= 0, times[index], self._last)
        sign = np.where(index >= 0, np.sign(values[index]), self._sign)
        if len(values):
            self._last, self._sign = float(last[-1]), float(sign[-1])
        return np.where(over | (times - last < self._fault.recovery), sign * limit, values)


class Drifting:
    """A force that grows by itself.

    Args:
        fault: How fast.
    """

    def __init__(self, fault: Drift):
        self._rate = fault.rate

    def disturb(self, times: Floats, values: Floats) -> Floats:
        """Return what is shown [N] at times [s from the trigger]."""
        return values + self._rate * times


def disturbances(
    faults: Faults | None, quantity: str, seed: int, run: int, channel: int
) -> list[Disturbance]:
    """Return what goes wrong in a channel's sensor in one acquisition.

    Args:
        faults: Of the scene, if any.
        quantity: That the channel measures.
        seed: Of the stand-in.
        run: Number of the acquisition.
        channel: Number of the channel in it.
    """
    if faults is None:
        return []
    if quantity == "velocity":
        if faults.speckle is None:
            return []
        key = np.random.SeedSequence(seed, spawn_key=(2, run, channel))
        return [DropOuts(faults.speckle, np.random.default_rng(key))]
    found: list[Disturbance] = [Drifting(faults.drift)] if faults.drift else []
    return [*found, Overloading(faults.overload)] if faults.overload else found
