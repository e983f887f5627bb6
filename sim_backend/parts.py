"""The parts of a scene: the arm's servo, the sensors, a weight on the key, the accuracy."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from sautereau.rig.units import Force, Frequency, Length, Mass, Section, Time, Unit, parse_quantity

JointStiffness = Annotated[float, Unit("N*m/rad", "27 N m/rad")]
JointDamping = Annotated[float, Unit("N*m*s/rad", "0.4 N m s/rad")]
Acceleration = Annotated[float, Unit("m/s**2", "9.81 m/s^2")]
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

    def __str__(self) -> str:
        if self.time is None:
            return f"{(self.force or 0.0) * 100:.3g} %"
        return f"{self.time * 1e6:.4g} us"
