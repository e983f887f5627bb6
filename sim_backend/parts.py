"""The parts of a scene: the arm's servo, the sensors, a weight on the key."""

from typing import Annotated

from pydantic import Field

from sautereau.rig.section import Force, Frequency, Section, Time
from sautereau.rig.units import Unit

JointStiffness = Annotated[float, Unit("N*m/rad", "27 N m/rad")]
JointDamping = Annotated[float, Unit("N*m*s/rad", "0.4 N m s/rad")]
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
    """Hz."""


class Push(Section):
    """A constant force on the key from the start, like that of a weight."""

    force: Force = Field(ge=0, le=100)
    """N, normal to the key at the pressing point."""
    duration: Time = Field(gt=0, le=10)
    """s, after which it is removed."""
    rest: Time = Field(default=0.0, ge=0, le=10)
    """s, for which the simulation continues after that."""
