"""The force of the finger on the key, as a piezoelectric transducer measures it."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.random import Generator

from sautereau.rig.schema import Rig
from sautereau.sim_backend.fault_tables import Drift, Faults, Overload
from sautereau.sim_backend.physics.events import Motions
from sautereau.sim_backend.sensors.simulated import Disturbance, SimulatedQuantity, Source
from sautereau.trajectory.motion import Floats


class Overloading:
    """An amplifier whose output stays at its limit while it is overloaded and recovers.

    Args:
        fault: Limit and recovery time.
    """

    def __init__(self, fault: Overload):
        self._fault = fault
        self._last, self._sign = -math.inf, 0.0

    def disturb(self, times: Floats, values: Floats) -> Floats:
        """Return the output [N] at times [s from the trigger]; call it in order."""
        limit = self._fault.force
        over = np.abs(values) >= limit
        index = np.maximum.accumulate(np.where(over, np.arange(len(values)), -1))
        last = np.where(index >= 0, times[index], self._last)
        sign = np.where(index >= 0, np.sign(values[index]), self._sign)
        if len(values):
            self._last, self._sign = float(last[-1]), float(sign[-1])
        return np.where(over | (times - last < self._fault.recovery), sign * limit, values)


class Drifting:
    """A force that drifts from the trigger on.

    Args:
        fault: Rate of the drift.
    """

    def __init__(self, fault: Drift):
        self._rate = fault.rate

    def disturb(self, times: Floats, values: Floats) -> Floats:
        """Return the output [N] at times [s from the trigger]."""
        return values + self._rate * times


def _source(rig: Rig) -> Source:
    def force(motions: Motions) -> Floats:
        return motions.finger_force

    return force


def _faults(faults: Faults, random: Generator) -> Sequence[Disturbance]:
    found: list[Disturbance] = [Drifting(faults.drift)] if faults.drift else []
    return [*found, Overloading(faults.overload)] if faults.overload else found


FORCE = SimulatedQuantity(
    source=_source,
    noise=lambda sensors: sensors.force_noise,
    hum=lambda sensors: sensors.hum,
    faults=_faults,
    jumps=True,
    static=True,
)
"""Force of the finger on the key [N]."""
