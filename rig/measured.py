"""The quantities that an analog input can measure, and those of other packages.

A channel of the acquisition names its quantity; unit and dimension of its `scale` follow from it.
"""

from dataclasses import dataclass

from sautereau.rig.errors import RigError
from sautereau.rig.registry import Registry


@dataclass(frozen=True)
class MeasuredQuantity:
    """What a sensor measures."""

    name: str
    """Name in the rig file: `velocity`."""
    unit: str
    """SI unit of the signal, as pint spells it: `m/s`."""
    meaning: str
    """What is measured, and where."""
    positive: str
    """Sign convention: what a positive value means."""
    example: str
    """A scale as the rig file writes it: `25 mm/s/V`."""

    @property
    def scale_unit(self) -> str:
        """SI unit of a sensor's scale: `m/s/V`."""
        return f"{self.unit}/V"


VELOCITY = MeasuredQuantity(
    "velocity",
    "m/s",
    "velocity of the key at the vibrometer's laser spot",
    "the key moves down at the spot",
    "25 mm/s/V",
)
FORCE = MeasuredQuantity(
    "force",
    "N",
    "force of the finger on the key, normal to it",
    "the finger presses on the key",
    "1 N/V",
)
DISPLACEMENT = MeasuredQuantity(
    "displacement",
    "m",
    "displacement of the key at the sensor's spot, from its rest",
    "the key is below its rest at the spot",
    "1 mm/V",
)
ACCELERATION = MeasuredQuantity(
    "acceleration",
    "m/s**2",
    "acceleration of the key at the laser spot",
    "the key accelerates downwards at the spot",
    "98.1 m/s^2/V",
)
SOUND_PRESSURE = MeasuredQuantity(
    "sound_pressure",
    "Pa",
    "sound pressure at a microphone",
    "the pressure is above its mean",
    "20 Pa/V",
)
VOLTAGE = MeasuredQuantity(
    "voltage",
    "V",
    "voltage of a source that is none of the others",
    "as the input is wired",
    "1 V/V",
)

NAMES = ("velocity", "force", "displacement", "acceleration", "sound_pressure", "voltage")
MEASURED = Registry(
    "sautereau.measured_quantities",
    "measured quantity",
    {name: f"sautereau.rig.measured:{name.upper()}" for name in NAMES},
    RigError,
)
"""Each is a `MeasuredQuantity`. The analysis uses velocity and force; the others are recorded."""
