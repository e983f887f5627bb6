"""A scene: what the stand-in models, and how finely or how accurately."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, ValidationError, model_validator

from sautereau.rig.faults import fault_list, validation_faults
from sautereau.rig.instrument import Choir
from sautereau.rig.load import read_toml, with_values
from sautereau.rig.packaged import named_text, packaged_names
from sautereau.rig.schema import Rig
from sautereau.rig.section import Angle, Section, Time
from sautereau.sim_backend.accuracy import Accuracy
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.faults.tables import Faults
from sautereau.sim_backend.parts import Push, Sensors, Servo


def _accuracy(text: str) -> str:
    Accuracy.parse(text)
    return text


class Scene(Section):
    """What is simulated; what it leaves out costs nothing."""

    description: str = ""
    """What the scene is for."""
    finger: Literal["push", "ideal", "servo"]
    """`push` is a constant force, `ideal` follows the controller's reference exactly, `servo`
    is two driven links."""
    plectrum: Literal["none", "auto", "elastica", "rods", "beam", "two-beam", "fe"]
    """Level of the plectrum; `none` leaves the strings mute."""
    string: Literal["none", "auto", "spring", "modal"]
    """The strings that the plectra meet."""
    friction: bool
    """Whether pivot and registers have their friction."""
    felt: bool
    """Whether the key's front felt is there."""
    tongue: bool = False
    """Whether a falling plectrum has to pass the string; else it is out of its reach."""
    damper: bool = False
    """Whether the jacks carry their dampers."""
    engine: Literal["auto", "rigid", "reduced"] = "rigid"
    """`rigid` bodies, or the `reduced` equation of a key that a push or an ideal finger moves."""
    step: Time | None = Field(default=None, ge=1e-7, le=2e-3)
    """s, longest step; the one taken divides the controller's sample."""
    accuracy: Annotated[str, AfterValidator(_accuracy)] | None = None
    """In place of a step: largest error of events ("10 us") or of forces ("0.1 %")."""
    iterations: int = Field(default=10, ge=1, le=1000)
    """Of the rigid bodies' constraint solver, each step."""
    push: Push | None = None
    """The force; needed by `finger = "push"` alone."""
    servo: Servo | None = None
    """The arm's servo; needed by `finger = "servo"` alone."""
    sensors: Sensors | None = None
    """The sensor chain; without it every sensor gives the truth, at once."""
    faults: Faults | None = None
    """What goes wrong; without it nothing does."""
    start_offset: tuple[Angle, Angle] = (0.03, -0.03)
    """rad, of the joints from their home switches when power comes on."""
    more_choirs: tuple[Choir, ...] | None = None
    """The simulated instrument's further choirs, in place of the rig's."""
    truth: dict[str, Any] = Field(default_factory=dict)
    """Where the simulated instrument differs from the rig: values by dotted key."""
    record_truth: bool = False
    """Whether a file with the true events is left beside every recording, for tests."""

    @model_validator(mode="after")
    def _parts_fit(self):
        faults = []
        for part in ("push", "servo"):
            if (self.finger == part) != (getattr(self, part) is not None):
                faults.append(
                    f'finger: "{self.finger}" and the table [{part}] do not go together;'
                    f' finger = "{part}" needs it, and only that; add or remove the table'
                )
        if (self.plectrum == "none") != (self.string == "none"):
            faults.append(
                f'plectrum: "{self.plectrum}" and string "{self.string}" do not go together;'
                " leave out both or neither"
            )
        if (self.step is None) == (self.accuracy is None):
            given = "neither is" if self.step is None else "both are"
            faults.append(f"step, accuracy: {given} given; give one of them")
        if self.accuracy is None:
            for name in ("engine", "plectrum", "string"):
                if getattr(self, name) == "auto":
                    faults.append(
                        f'{name}: "auto" is chosen by the accuracy asked for; give accuracy in'
                        f" place of step, or choose the {name}"
                    )
        if self.engine == "reduced" and self.finger == "servo":
            faults.append(
                'engine: "reduced" is an equation of the key alone, and a servo\'s arm has two'
                ' joints more; take engine = "rigid"'
            )
        if self.engine == "reduced" and self.string == "modal":
            faults.append(
                'engine: "reduced" is an equation of the key alone, and a modal string moves by'
                ' itself; take engine = "rigid" or string = "spring"'
            )
        if faults:
            raise ValueError("\n".join(faults))
        return self

    def true_rig(self, rig: Rig) -> Rig:
        """Return the bench as it is in this scene, which the rig only supposes.

        Raises:
            SceneError: The scene shows a part of which the rig has no numbers.
        """
        if self.more_choirs is not None:
            rig = rig.model_copy(update={"more_choirs": self.more_choirs})
        rig = with_values(rig, self.truth) if self.truth else rig
        faults = []
        for number, jack in enumerate([rig.jack, *(choir.jack for choir in rig.more_choirs)]):
            at = f"more_choirs[{number - 1}].jack" if number else "jack"
            for part in ("tongue", "damper"):
                if getattr(self, part) and getattr(jack, part) is None:
                    faults.append(
                        f"rig {rig.name}: the scene shows the {part}, and the rig has no table"
                        f" [{at}.{part}]; add it, or set {part} = false in the scene"
                    )
        if faults:
            raise SceneError("\n".join(faults))
        return rig

    def as_wired(self, rig: Rig) -> Rig:
        """Return the rig with the calibration charts of this scene's sensors.

        What a chart said of a value, its source or its range, does not hold for an ideal sensor's.
        """
        if self.sensors is not None:
            return rig
        ideal = {"delay": "0 s", "low_pass": "0 Hz", "high_pass": "0 Hz"}
        charts = {
            f"daq.channels.{i}.{name}": value
            for i in range(len(rig.daq.channels))
            for name, value in ideal.items()
        }
        origins = {
            kind: {key: said for key, said in getattr(rig, kind).items() if key not in charts}
            for kind in ("assumed", "sources")
        }
        return with_values(rig, charts).model_copy(update=origins)


def load_scene(name: str | Path = "paper") -> Scene:
    """Load a scene from a TOML file, or a packaged one by its name.

    Raises:
        SceneError: Lists every fault of the file.
    """
    text, origin, _ = named_text(name, "sautereau.sim_backend.scenes", "scene", SceneError)
    return parse_scene(text, origin)


def packaged_scenes() -> list[str]:
    """Return the names of the scenes that come with sautereau."""
    return packaged_names("sautereau.sim_backend.scenes")


def parse_scene(text: str, origin: str = "scene") -> Scene:
    """Build a scene from the text of a TOML file; ``origin`` names it in errors."""
    document = read_toml(text, origin, SceneError)
    try:
        return Scene.model_validate(document)
    except ValidationError as error:
        raise SceneError(fault_list(origin, validation_faults(error, Scene, text))) from error
