"""How the stand-in simulates each measured quantity: its signal, its noise and its faults."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from numpy.random import Generator

from sautereau.rig.registry import Registry
from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.fault_tables import Faults
from sautereau.sim_backend.parts import Sensors
from sautereau.sim_backend.physics.events import Motions
from sautereau.trajectory.motion import Floats

Source = Callable[[Motions], Floats]
"""Returns the quantity [SI] at the instants of a motion, shape (n,); called in order of time."""


class Disturbance(Protocol):
    """A fault that changes the output of a sensor."""

    def disturb(self, times: Floats, values: Floats) -> Floats:
        """Return the sensor's output [SI] at times [s from the trigger]; call it in order."""
        ...


def _none(sensors: Sensors) -> float:
    return 0.0


def _no_faults(faults: Faults, random: Generator) -> Sequence[Disturbance]:
    return ()


@dataclass(frozen=True)
class SimulatedQuantity:
    """How the stand-in simulates a quantity that the rig's channels measure."""

    source: Callable[[Rig], Source]
    """Given the simulated bench, returns the source of one acquisition."""
    noise: Callable[[Sensors], float] = _none
    """Returns the rms of the white noise over the sensor's band, in the quantity's unit."""
    hum: Callable[[Sensors], float] = _none
    """Returns the amplitude of the mains hum, in the quantity's unit."""
    faults: Callable[[Faults, Generator], Sequence[Disturbance]] = _no_faults
    """Returns the faults of the scene that apply, in the order in which they act."""
    jumps: bool = False
    """Whether the quantity jumps at a release and at a return, as a force does."""
    static: bool = False
    """Whether it may be nonzero before the trigger, as a force; else the sensor starts from 0."""


SIMULATED = Registry(
    "sautereau.simulated_quantities",
    "simulated quantity",
    {
        "velocity": "sautereau.sim_backend.sensors.velocity:VELOCITY",
        "force": "sautereau.sim_backend.sensors.force:FORCE",
    },
    SceneError,
)
"""`SimulatedQuantity` by the name of the measured quantity."""
