"""The velocity of the key's front, as a laser vibrometer measures it."""

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator

from sautereau.rig.schema import Rig
from sautereau.sim_backend.fault_tables import Faults, Speckle
from sautereau.sim_backend.physics.events import Motions
from sautereau.sim_backend.sensors.simulated import Disturbance, SimulatedQuantity, Source
from sautereau.trajectory.motion import Floats


class DropOuts:
    """Losses of the vibrometer's light: the velocity is scaled down and has a false offset.

    Args:
        fault: Rate, duration and size of the drop-outs.
        random: Source of their times and false velocities.
    """

    def __init__(self, fault: Speckle, random: Generator):
        self._fault, self._random = fault, random
        self._end = 0.0
        self._draw()

    def disturb(self, times: Floats, values: Floats) -> Floats:
        """Return the output [m/s] at times [s from the trigger]; call it in order."""
        values = values.copy()
        while len(times):
            first, stop = np.searchsorted(times, (self._start, self._end))
            values[first:stop] = values[first:stop] * self._fault.level + self._spike
            if stop == len(times):
                break
            self._draw()
        return values

    def _draw(self) -> None:
        """Draw the next drop-out."""
        self._start = self._end + self._random.exponential(1 / self._fault.rate)
        self._end = self._start + self._fault.duration
        self._spike = self._fault.spike * self._random.uniform(-1.0, 1.0)


def _source(rig: Rig) -> Source:
    arm = rig.key.laser_arm

    def velocity(motions: Motions) -> Floats:
        return motions.angular_velocity * arm

    return velocity


def _faults(faults: Faults, random: Generator) -> Sequence[Disturbance]:
    return [DropOuts(faults.speckle, random)] if faults.speckle else []


VELOCITY = SimulatedQuantity(
    source=_source, noise=lambda sensors: sensors.velocity_noise, faults=_faults
)
"""Velocity of the key's front [m/s]."""
