"""How the stand-in simulates each measured quantity: its signal, its noise and its faults."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.random import Generator

from sautereau.analysis.model.string.string import ModalState, ModalString
from sautereau.rig.acquisition import OF_STRING
from sautereau.rig.registry import Registry
from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.fault_tables import Drift, Faults, Overload, Speckle
from sautereau.sim_backend.parts import Sensors
from sautereau.sim_backend.physics.events import Motions
from sautereau.trajectory.motion import Floats

Source = Callable[[Motions], Floats]
"""Returns the quantity [SI] at the instants of a motion, shape (n,); called in order of time.

Two equal instants are both sides of a jump; see `Motions`."""


class Disturbance(Protocol):
    """A fault that changes the output of a sensor."""

    def disturb(self, times: Floats, values: Floats) -> Floats:
        """Return the sensor's output [SI] at times [s from the trigger]; call it in order."""
        ...


@dataclass(frozen=True)
class SimulatedQuantity:
    """How the stand-in simulates a quantity that the rig's channels measure."""

    source: Callable[[Rig], Source]
    """Given the simulated bench, returns the source of one acquisition."""
    noise: Callable[[Sensors], float] = lambda sensors: 0.0
    """Returns the rms of the white noise over the sensor's band, in the quantity's unit."""
    hum: Callable[[Sensors], float] = lambda sensors: 0.0
    """Returns the amplitude of the mains hum, in the quantity's unit."""
    faults: Callable[[Faults, Generator], Sequence[Disturbance]] = lambda faults, random: ()
    """Returns the faults of the scene that apply, in the order in which they act."""
    static: bool = False
    """Whether it may be nonzero before the trigger, as a force; else the sensor starts from 0."""
    on_transducer: bool = False
    """Whether the scene's resonance of the force transducer shows in it."""
    of_string: Callable[[ModalString, ModalState, float | None], Floats] | None = None
    """Returns the quantity of a string from the motion of its modes at n times, shape (n,), and the
    channel's `place`; `source` is then the simulated time."""


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


class Acceleration:
    """Acceleration of the key's front: the mean over each step of the simulation.

    Args:
        rig: With the key's `laser_arm`.
    """

    def __init__(self, rig: Rig):
        self._arm = rig.key.laser_arm
        self._last = 0.0, 0.0

    def __call__(self, motions: Motions) -> Floats:
        """Return the acceleration [m/s^2] at the instants of a motion; call it in order of time.

        At a jump of the velocity, two equal instants, there is no acceleration of its own.
        """
        rates, self._last = mean_rates(motions.time, motions.angular_velocity, self._last)
        return self._arm * rates


def mean_rates(
    time: Floats, values: Floats, last: tuple[float, float]
) -> tuple[Floats, tuple[float, float]]:
    """Return the mean rate of change over the step to each time, and the last time and value.

    At a jump, two equal times, there is no rate of its own.

    Args:
        time: s, shape (n,).
        values: Of any unit, shape (n,).
        last: Time and value before them.
    """
    steps = np.diff(time, prepend=last[0])
    taken = steps > 0
    if not taken.any():
        return np.zeros(len(time)), last
    quotient = np.diff(values, prepend=last[1])[taken] / steps[taken]
    return np.interp(time, time[taken], quotient), (float(time[-1]), float(values[-1]))


def _faults_of_force(faults: Faults, random: Generator) -> Sequence[Disturbance]:
    found: list[Disturbance] = [Drifting(faults.drift)] if faults.drift else []
    return [*found, Overloading(faults.overload)] if faults.overload else found


VELOCITY = SimulatedQuantity(
    source=lambda rig: lambda motions: motions.angular_velocity * rig.key.laser_arm,
    noise=lambda sensors: sensors.velocity_noise,
    faults=lambda faults, random: [DropOuts(faults.speckle, random)] if faults.speckle else [],
)
"""Velocity of the key's front [m/s], as a laser vibrometer measures it."""

FORCE = SimulatedQuantity(
    source=lambda rig: lambda motions: motions.finger_force + motions.blow,
    noise=lambda sensors: sensors.force_noise,
    hum=lambda sensors: sensors.hum,
    faults=_faults_of_force,
    static=True,
    on_transducer=True,
)
"""Force of the finger on the key [N], as a piezoelectric transducer measures it."""

DISPLACEMENT = SimulatedQuantity(
    source=lambda rig: lambda motions: motions.angle * rig.key.laser_arm
)
"""Displacement of the key's front [m], from its rest."""

ACCELERATION = SimulatedQuantity(source=Acceleration)  # Acceleration of the key's front [m/s^2]


def _time(rig: Rig) -> Source:
    return lambda motions: motions.time


STRING_DISPLACEMENT = SimulatedQuantity(
    _time, static=True, of_string=lambda string, modes, place: string.displacement(modes.q, place)
)
"""Displacement of a string [m], upwards."""

STRING_VELOCITY = SimulatedQuantity(
    _time, static=True, of_string=lambda string, modes, place: string.displacement(modes.v, place)
)
"""Velocity of a string [m/s], upwards."""

BRIDGE_FORCE = SimulatedQuantity(
    _time, static=True, of_string=lambda string, modes, place: string.bridge_force(modes.q)
)
"""Force of a string on the bridge [N], upwards."""

SILENT = SimulatedQuantity(source=lambda rig: lambda motions: np.zeros(len(motions.time)))
"""A sensor of something that the stand-in does not simulate, such as sound: its output is 0."""

SIMULATED = Registry(
    "sautereau.simulated_quantities",
    "simulated quantity",
    {
        name: f"sautereau.sim_backend.sensors.simulated:{constant}"
        for name, constant in (
            ("velocity", "VELOCITY"),
            ("force", "FORCE"),
            ("displacement", "DISPLACEMENT"),
            ("acceleration", "ACCELERATION"),
            ("sound_pressure", "SILENT"),
            ("voltage", "SILENT"),
            *((name, name.upper()) for name in OF_STRING),
        )
    },
    SceneError,
)
"""`SimulatedQuantity` by the name of the measured quantity."""
