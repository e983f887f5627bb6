"""A scene: what the stand-in models, and how finely."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from rig.faults import fault_list, validation_faults
from rig.load import read_toml, with_values
from rig.packaged import named_text, packaged_names
from rig.schema import Angle, Force, Frequency, Rig, Section, Time
from rig.units import Unit
from sim_backend.errors import SceneError

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
    """kg m^2, torque for each unit of commanded acceleration."""


class Sensors(Section):
    """What the sensors add to the truth; delay, filters and range are the rig's."""

    velocity_noise: Annotated[float, Unit("m/s", "0.05 mm/s")] = Field(ge=0)
    """m/s rms over the sensor's band."""
    force_noise: Force = Field(ge=0)
    """N rms over the sensor's band."""
    hum: Force = Field(ge=0)
    """N, amplitude of mains hum on the force."""
    hum_frequency: Frequency = Field(gt=0)
    """Hz."""


class Scene(Section):
    """What is simulated; what it leaves out costs nothing."""

    description: str = ""
    """What the scene is for."""
    finger: Literal["ideal", "servo"]
    """`ideal` follows the controller's reference exactly, `servo` is two driven links."""
    plectrum: Literal["none", "elastica"]
    """Level of the plectrum; `none` leaves the string mute."""
    string: Literal["none", "spring"]
    """The string that the plectrum meets."""
    friction: bool
    """Whether pivot and register have their friction."""
    felt: bool
    """Whether the key's front felt is there."""
    step: Time = Field(gt=0, le=1e-3)
    """s, longest step; the one taken divides the controller's sample."""
    iterations: int = Field(ge=1, le=1000)
    """Of the rigid bodies' constraint solver, each step."""
    servo: Servo | None = None
    """The arm's servo; needed by `finger = "servo"` alone."""
    sensors: Sensors | None = None
    """The sensor chain; without it every sensor gives the truth, at once."""
    start_offset: tuple[Angle, Angle] = (0.03, -0.03)
    """rad, of the joints from their home switches when power comes on."""
    truth: dict[str, Any] = Field(default_factory=dict)
    """Where the simulated instrument differs from the rig: values by dotted key."""

    @model_validator(mode="after")
    def _parts_fit(self):
        faults = []
        if (self.finger == "servo") != (self.servo is not None):
            faults.append(
                f'finger: "{self.finger}" and the table [servo] do not go together;'
                " a servo needs it, and only a servo; add or remove the table"
            )
        if (self.plectrum == "none") != (self.string == "none"):
            faults.append(
                f'plectrum: "{self.plectrum}" and string "{self.string}" do not go together;'
                " leave out both or neither"
            )
        if faults:
            raise ValueError("\n".join(faults))
        return self

    def true_rig(self, rig: Rig) -> Rig:
        """Return the bench as it is in this scene, which the rig only supposes."""
        return with_values(rig, self.truth) if self.truth else rig

    def as_wired(self, rig: Rig) -> Rig:
        """Return the rig with the calibration charts of this scene's sensors."""
        if self.sensors is not None:
            return rig
        ideal = {"delay": "0 s", "low_pass": "0 Hz", "high_pass": "0 Hz"}
        return with_values(
            rig,
            {
                f"daq.channels.{i}.{name}": value
                for i in range(len(rig.daq.channels))
                for name, value in ideal.items()
            },
        )


def load_scene(name: str | Path = "paper") -> Scene:
    """Load a scene from a TOML file, or a packaged one by its name.

    Raises:
        SceneError: Lists every fault of the file.
    """
    text, origin, _ = named_text(name, "sim_backend.scenes", "scene", SceneError)
    return parse_scene(text, origin)


def packaged_scenes() -> list[str]:
    """Return the names of the scenes that come with sautereau."""
    return packaged_names("sim_backend.scenes")


def parse_scene(text: str, origin: str = "scene") -> Scene:
    """Build a scene from the text of a TOML file; ``origin`` names it in errors."""
    document = read_toml(text, origin, SceneError)
    try:
        return Scene.model_validate(document)
    except ValidationError as error:
        raise SceneError(fault_list(origin, validation_faults(error, Scene, text))) from error
