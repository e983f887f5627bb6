"""The parts of a scene: servo, sensors, fingertip, key, push, accuracy, and the controller."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal, cast

from pydantic import AfterValidator, Field

from sautereau.rig.capabilities import GalilModel, families
from sautereau.rig.units import (
    Angle,
    Force,
    Frequency,
    Length,
    Mass,
    Section,
    Time,
    Unit,
    parse_quantity,
)

JointStiffness = Annotated[float, Unit("N*m/rad", "27 N m/rad")]
JointDamping = Annotated[float, Unit("N*m*s/rad", "0.4 N m s/rad")]
Acceleration = Annotated[float, Unit("m/s**2", "9.81 m/s^2")]
JointTorque = Annotated[float, Unit("N*m", "20 mN m"), Field(ge=0)]
Friction = Annotated[float, Unit("N*m*s/rad", "0.01 N m s/rad"), Field(ge=0)]
Backlash = Annotated[float, Unit("rad", "0.02 deg"), Field(ge=0, le=0.1)]
GearStiffness = Annotated[float, Unit("N*m/rad", "2000 N m/rad"), Field(gt=0)]
JointInertia = Annotated[float, Unit("kg*m**2", "2e-3 kg m^2")]


class Servo(Section):
    """The two position loops of the arm, each a PID on encoder counts."""

    stiffness: tuple[JointStiffness, JointStiffness]
    """N m/rad, proportional gain at the joint."""
    damping: tuple[JointDamping, JointDamping]
    """N m s/rad, derivative gain at the joint."""
    integral_time: Time = Field(gt=0)
    """s, of the integral term."""
    feedforward: tuple[JointInertia, JointInertia]
    """kg m^2, torque per commanded acceleration."""


class Joints(Section):
    """Friction of the arm's joints, and backlash between their motors and the links."""

    dry_friction: tuple[JointTorque, JointTorque] = (0.0, 0.0)
    """N m, Coulomb friction of each joint, on the motor's side of backlash."""
    viscous_friction: tuple[Friction, Friction] = (0.0, 0.0)
    """N m s/rad, viscous friction of each joint, likewise."""
    backlash: tuple[Backlash, Backlash] = (0.0, 0.0)
    """rad, by which the link can turn while the motor, and the encoder on it, rests. It needs
    `arm.rotor_inertias`."""
    gear_stiffness: tuple[GearStiffness, GearStiffness] = (2000.0, 2000.0)
    """N m/rad, of a transmission with backlash beyond its play, at the joint."""
    gear_damping: tuple[Friction, Friction] = (0.2, 0.2)
    """N m s/rad, of a transmission with backlash while its teeth touch."""


class Sensors(Section):
    """Noise and hum of the sensors; their delay, filters and range are the rig's."""

    velocity_noise: Annotated[float, Unit("m/s", "0.05 mm/s")] = Field(ge=0)
    """m/s rms over the sensor's band."""
    force_noise: Force = Field(ge=0)
    """N rms over the sensor's band."""
    hum: Force = Field(ge=0)
    """N, amplitude of mains hum on the force."""
    hum_frequency: Frequency = Field(gt=0)
    """Hz, of the hum."""


class Transducer(Section):
    """The force transducer with the mass before it, as an oscillator that the force drives."""

    resonance: Frequency = Field(gt=0, le=1e6)
    """Hz, undamped."""
    damping: float = Field(gt=0, lt=1)
    """Dimensionless, fraction of critical damping."""


class Fingertip(Section):
    """A compliant pad on the fingertip, a spring and a damper that can only push."""

    stiffness: Annotated[float, Unit("N/m", "30 kN/m")] = Field(gt=0, le=1e7)
    """N/m, of the pad."""
    damping: Annotated[float, Unit("N*s/m", "5 N s/m")] = Field(default=0.0, ge=0, le=1e4)
    """N s/m, of the pad."""


class Bending(Section):
    """The key's first bending mode: its front turns against its back, about the balance pin."""

    frequency: Frequency = Field(gt=0, le=5000)
    """Hz, of the bare key, free but for its pin; 150 to 800 Hz is usual."""
    damping: float = Field(default=0.01, ge=0, lt=1)
    """Dimensionless, fraction of critical damping."""
    front: float = Field(default=0.5, ge=0.05, le=0.95)
    """Dimensionless, fraction of the key's inertia before the pin."""


class Play(Section):
    """Play at the balance pin: the key sinks into the felt under it, down to the rail."""

    stiffness: Annotated[float, Unit("N/m", "200 kN/m")] = Field(gt=0, le=1e8)
    """N/m, of the felt."""
    damping: Annotated[float, Unit("N*s/m", "5 N s/m")] = Field(default=0.0, ge=0, le=1e4)
    """N s/m, of the felt."""
    clearance: Length = Field(default=0.5e-3, gt=0, le=5e-3)
    """m, from the key at rest down to the rail."""
    mass: Mass = Field(default=0.05, ge=1e-3, le=1)
    """kg, of the key; its centre of mass is at the pin."""


class Push(Section):
    """A constant force on the key from the start, like that of a weight."""

    force: Force = Field(ge=0, le=100)
    """N, normal to the key at the pressing point."""
    duration: Time = Field(gt=0, le=10)
    """s, after which it is removed."""
    rest: Time = Field(default=0.0, ge=0, le=10)
    """s, for which the simulation continues after that."""


class Weight(Section):
    """A weight on a thread at the fingertip, with the laser aimed at it: for `setup force`.

    It loads the transducer alone; the arm does not deflect under it. In the first acquisition the
    thread is cut, and the laser sees the weight, not the key.
    """

    mass: Mass = Field(gt=0, le=10)
    """kg, mass of the weight."""
    cut: Time = Field(default=1.0, ge=0, le=60)
    """s after the trigger's edge, at which the thread is cut."""
    fall: Length = Field(default=0.3, gt=0, le=10)
    """m, until the weight lands."""


@dataclass(frozen=True)
class Accuracy:
    """A largest error of times of events or of forces, which a scene may give instead of a step.

    One of the two is None.
    """

    time: float | None
    """s."""
    force: float | None
    """Dimensionless, fraction of the largest force."""

    @classmethod
    def parse(cls, text: str) -> "Accuracy":
        """Read "10 us" or "0.1 %".

        Raises:
            ValueError: It is neither a time nor a percentage, or not positive.
        """
        of_force = text.strip().endswith("%")
        value = parse_quantity(text.replace("%", "percent"), "" if of_force else "s")
        if not 0 < value < (1 if of_force else 1e-2):
            limits = "between 0 and 100 %" if of_force else "between 0 and 10 ms"
            raise ValueError(f"accuracy: {text!r} must lie {limits}; change it")
        return cls(None, value) if of_force else cls(value, None)

    def excess(self, time: float, force: float) -> float:
        """Return errors of events [s] and of forces over the one asked for, dimensionless."""
        if self.time is not None:
            return time / self.time
        return force / (self.force or math.inf)

    def rounded_up(self) -> "Accuracy":
        """Return the next larger accuracy of two significant digits."""
        value = self.force if self.time is None else self.time
        unit = 10.0 ** (math.floor(math.log10(value or 1.0)) - 1)
        value = math.ceil((value or 0.0) / unit - 1e-9) * unit
        return Accuracy(None, value) if self.time is None else Accuracy(value, None)

    def __str__(self) -> str:
        if self.time is None:
            return f"{(self.force or 0.0) * 100:.3g} %"
        return f"{self.time * 1e6:.4g} us"


def _known_model(text: str) -> str:
    if GalilModel.of(text) is None:
        raise ValueError(
            f"model: {text!r} is not a known controller; give one of {', '.join(families())}, with"
            " the number of its axes for x and without the hyphen, such as DMC4020"
        )
    return text


class ControllerUnit(Section):
    """The Galil controller as it was bought, wired and configured: the table `[controller]`.

    Behaviour that the manufacturer's reference does not specify can be set either way, to test
    both.
    """

    model: Annotated[str, AfterValidator(_known_model)] = "DMC4020"
    """Model number, as the controller gives it in its answer to ^R^V. It decides the axes and the
    commands: of its axes, A and B are emulated."""
    firmware: str = Field(default="1.3a", pattern=r"^[0-9]\.[0-9][a-z][0-9]*(-[A-Z]+)?$")
    """Revision. Firmware `...-FAST` has no PVT mode; before 1.2a there are fewer lines and array
    elements, and `AT n,1` is unknown."""
    serial_number: int = Field(default=12_345, ge=1)
    """Serial number of the processor board."""
    interface: Literal["rs232", "usb", "ethernet"] = "rs232"
    """Port to the host; `ethernet` is a TCP port with eight handles, `tcp://127.0.0.1:port`, that
    never echoes."""
    baud_rate: int = Field(default=0, ge=0, le=921_600)
    """Bits per second at which a serial line carries its characters, 10 bits each, in simulated
    time; 0 for a line that takes no time."""
    input_buffer: int = Field(default=512, ge=16)
    """Characters that wait while parameters are burned; later ones are lost, with error 5."""
    line_length: int = Field(default=80, ge=40, le=80)
    """Characters in a line of a program or of a command."""
    burned: tuple[str, ...] = ("MO",)
    """Commands that were given and burned by `BN` before, such as `"BW 100"` (a brake on the
    output) or `"CN 1"`; without `MO` motors start powered."""
    burned_program: str = ""
    """Program burned by `BP`, with its lines; `#AUTO` runs at power-up."""
    amplifier: Literal["none", "D3040", "D3240", "D3540", "D3547", "D3640"] = "none"
    """Internal amplifier, which limits `TL` at its largest gain."""
    output_inverted: bool = False
    """Whether the output module makes `SB` a falling edge at the card."""
    output_delay: Time = Field(default=0.0, ge=0, le=0.1)
    """s, of the output's optocoupler."""
    index_angles: tuple[Angle, Angle] = (0.1, 0.1)
    """rad, of each joint from its home switch to the encoder's index, which recurs every
    revolution of the motor."""
    limit_switches: bool = False
    """Whether there are limit switches, at the limits of the arm's joints."""
    odd_pvt: Literal["truncate", "refuse"] = "truncate"
    """What happens to odd velocities and times of `PV`."""
    pvt_error_limit: bool = True
    """Whether `ER` with `OE` ends a PVT motion."""
    pvt_soft_limits: bool = True
    """Whether `FL` and `BL` end a PVT motion."""
    underrun: Literal["decelerate", "stop"] = "decelerate"
    """How a PVT motion ends at speed when its buffer is empty."""
    error_routine: bool = True
    """Whether `#CMDERR` is entered after a refused command of a program."""
    recorded_torque: Literal["integer", "volts"] = "integer"
    """What a recorded `_TT` holds: 32767 for 10 V, or volts."""
    at_jitter: int = Field(default=0, ge=0, le=16)
    """Samples by which `AT` may be late."""
    control_z: Literal["line", "attached"] = "line"
    """Place of the control-Z after an upload: on its own line, or after the last number."""
    usb_echo: bool = True
    """Whether a USB port echoes after power-up, as RS-232 does."""

    @cached_property
    def galil(self) -> GalilModel:
        """Axes of the model, and commands that model and firmware lack."""
        return cast(GalilModel, GalilModel.of(self.revision))  # `_known_model` knows it

    @property
    def revision(self) -> str:
        """Answer to ^R^V."""
        return f"{self.model} Rev {self.firmware}-SIM sautereau stand-in"

    @property
    def large_memory(self) -> bool:
        """Whether the firmware is 1.2a or later: 4,000 lines and 24,000 array elements."""
        return self.firmware.split("-")[0] >= "1.2a"
