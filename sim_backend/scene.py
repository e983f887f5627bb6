"""A scene: what the stand-in simulates, and with which step or accuracy."""

import re
from collections.abc import Iterable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator
from pydantic_core import to_jsonable_python

from sautereau.rig.acquisition import Daq
from sautereau.rig.disk import named_text, packaged_names
from sautereau.rig.document import flat
from sautereau.rig.errors import RigError
from sautereau.rig.faults import Condition, in_text, validating, without_effect
from sautereau.rig.instrument import Choir
from sautereau.rig.layers import read_toml, refuse_other
from sautereau.rig.load import with_values
from sautereau.rig.schema import Rig
from sautereau.rig.units import GRAVITY, Angle, Section, Time
from sautereau.sim_backend.device_types import DEVICE_TYPES, IDEAL
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.fault_tables import Faults
from sautereau.sim_backend.parts import (
    Acceleration,
    Accuracy,
    Bending,
    ControllerUnit,
    Fingertip,
    Joints,
    Play,
    Push,
    Sensors,
    Servo,
    Transducer,
    Weight,
)

SIMULATED = ("key.", "jack.", "plectrum.", "string.", "more_choirs.", "arm.", "daq.channels.")
"""Where the keys of a rig begin that `[truth]` may give another value."""
SENSED = {"delay": "0 s", "low_pass": "0 Hz", "low_pass_order": 0, "high_pass": "0 Hz"}
"""Keys of a channel that ideal sensors do not have, with their values."""
UNUSED = (
    *("key.front_arm", "key.neighbour_height", "key.modes", "plectrum.density", "string.name"),
    *("arm.servo_stiffness", "arm.servo_damping", "arm.elbow", "arm.tilt_limit"),
    *("arm.position_tolerance", "arm.approach_speed", "arm.speed_limit", "arm.acceleration_limit"),
    *("arm.jerk_limit", "arm.mount_x", "arm.mount_z"),
)
"""Keys of an instrument and an arm on which no simulated part depends."""
FRICTION, MODAL = Condition("friction", (True,)), Condition("string", ("modal", "auto"))
TRUTH_ACTS_IF = {
    "jack.tongue.": (Condition("tongue", (True,)),),
    "jack.damper.": (Condition("damper", (True,)),),
    "key.felt_": (Condition("felt", (True,)),),
    "key.pivot_": (FRICTION,),
    "jack.register_friction": (FRICTION,),
    "arm.fingertip_friction": (FRICTION,),
    "string.frequency": (MODAL,),
    "string.inharmonicity": (MODAL,),
}
"""Settings of a scene with which values of an instrument and an arm act."""
SERVO = Condition("finger", ("servo",))
ACTS_IF = {
    "push": (Condition("finger", ("push",)),),
    "servo": (SERVO,),
    "joints": (SERVO,),
    "fingertip": (Condition("finger", ("ideal", "servo")),),
    "iterations": (Condition("engine", ("rigid", "auto")),),
}
"""Settings of a scene with which others act."""


def _accuracy(text: str) -> str:
    Accuracy.parse(text)
    return text


def _dotted(truth: Any) -> Any:
    """Return values by dotted key, also of tables, as keys without quotes make them."""
    return flat(truth) if isinstance(truth, dict) and truth else truth


def _products(card: str | dict[str, str]) -> str | dict[str, str]:
    for text in card.values() if isinstance(card, dict) else [card]:
        if text not in DEVICE_TYPES:
            known = ", ".join(f'"{name}"' for name in DEVICE_TYPES)
            raise ValueError(f'"{text}" is not a known DAQ device; give one of {known}')
    return card


def _engine(name: Any) -> Any:
    """Return the present name of an engine, also of those before version 0.2."""
    return "exact" if name in ("reduced", "reference") else name


class Scene(Section):
    """What is simulated; a part that is disabled costs nothing."""

    description: str = ""
    """Purpose of the scene."""
    finger: Literal["push", "ideal", "servo"]
    """`push` is a constant force, `ideal` follows the controller's reference exactly, `servo`
    has two links with motors."""
    plectrum: Literal["none", "auto", "elastica", "rods", "beam", "two-beam", "fe"]
    """Plectrum bending model; `none` for no plucking, `auto` for the one that represents all that
    the rig describes."""
    string: Literal["none", "auto", "spring", "modal"]
    """String model: a massless `spring`, or `modal`, a string in its modes that vibrates after the
    release. With an `accuracy`, `auto` lets the stand-in choose, here and below."""
    friction: bool
    """Whether pivot, registers and fingertip have friction; without it `arm.fingertip_friction` has
    no effect."""
    felt: bool
    """Whether the key has its front felt."""
    tongue: bool = False
    """Whether a falling plectrum must pass the string; else it passes without a force."""
    damper: bool = False
    """Whether the jacks carry their dampers."""
    engine: Annotated[Literal["auto", "rigid", "exact"], BeforeValidator(_engine)] = "auto"
    """`rigid` bodies, or the `exact` solution of the equations from event to event, which has no
    modal string, bending or play. With a `step`, `auto` is `exact` where that solves the scene and
    numba is installed (the extra `fast`), else `rigid`."""
    step: Time | None = Field(default=None, ge=1e-7, le=2e-3)
    """s, longest step; the step used divides the controller's sample period."""
    accuracy: Annotated[str, AfterValidator(_accuracy)] | None = None
    """Instead of a step: largest error of events ("10 us") or of forces ("0.1 %")."""
    iterations: int = Field(default=10, ge=1, le=1000)
    """Iterations of the rigid bodies' constraint solver, per step; not with `engine = "exact"`."""
    push: Push | None = None
    """Only with `finger = "push"`, which needs it."""
    servo: Servo | None = None
    """Only with `finger = "servo"`, which needs it."""
    joints: Joints | None = None
    """Without it the motors turn with the links, without friction. With a servo; rigid bodies
    only."""
    sensors: Sensors | None = None
    """Without it all sensors are exact and without delay."""
    bending: Bending | None = None
    """Without it the key is rigid. Rigid bodies only."""
    play: Play | None = None
    """Without it the pin is fixed. Rigid bodies only; not with `bending`, nor with an ideal finger
    without `fingertip`."""
    gravity: Acceleration = Field(default=GRAVITY, ge=0, le=1000)
    """m/s^2, downwards; the key's static gravity moment is proportional to it."""
    fingertip: Fingertip | None = None
    """Without it the fingertip is rigid. With an ideal finger or a servo."""
    transducer: Transducer | None = None
    """Without it the force is measured as it is."""
    weight: Weight | None = None
    """Without it the force is that of the key."""
    card: Annotated[str | dict[str, str], AfterValidator(_products)] = IDEAL.product
    """Product type of the DAQ device; by default an ideal one with the rig's inputs. Of several
    modules of a chassis a table, by their names: `{ cDAQ1Mod1 = "NI 9215" }`."""
    faults: Faults | None = None
    controller: ControllerUnit | None = None
    """Without it the controller is a new one with `MO` burned."""
    start_offset: tuple[Angle, Angle] = (0.03, -0.03)
    """rad, of the joints from their home switches at power-up."""
    more_choirs: tuple[Choir, ...] | None = None
    """Instead of the rig's."""
    truth: Annotated[dict[str, Any], BeforeValidator(_dotted)] = Field(default_factory=dict)
    """Where the simulated instrument differs from the rig: values by dotted key, such as
    `"jack.mass" = "7 g"`. A value on which no simulated part depends is refused."""
    record_truth: bool = False
    """Whether a file with the true events is written beside every recording, for tests."""

    @model_validator(mode="after")
    def _parts_fit(self):
        fields = type(self).model_fields
        given = {name: getattr(self, name) for name in ACTS_IF}
        given = {name: value for name, value in given.items() if value != fields[name].default}
        faults = [f"{key}: {why}" for key, why in without_effect(given, ACTS_IF, self)]
        faults += self._finger_faults()
        if (self.plectrum == "none") != (self.string == "none"):
            faults.append(
                f'plectrum: "{self.plectrum}" and string = "{self.string}" contradict each other;'
                ' set both or neither to "none"'
            )
        faults += self._accuracy_faults()
        if self.play is not None and self.bending is not None:
            faults.append(
                "play, bending: the key of one scene either sinks or bends; remove one of the"
                " tables"
            )
        if self.engine == "exact":
            faults += self.unsolved
        if faults:
            raise ValueError("\n".join(faults))
        return self

    def _finger_faults(self) -> Iterator[str]:
        """Yield what the chosen finger lacks."""
        if self.finger != "ideal" and getattr(self, self.finger) is None:
            yield f'finger: "{self.finger}" needs the table [{self.finger}]; add it'
        if self.finger == "ideal" and self.fingertip is None and self.play is not None:
            yield (
                'play: the rigid fingertip of finger = "ideal" prescribes the angle of a key on a'
                " fixed pin; add the table [fingertip], or change finger"
            )

    def _accuracy_faults(self) -> Iterator[str]:
        """Yield what no accuracy decides, and what decides it twice."""
        if (self.step is None) == (self.accuracy is None):
            given = "neither is" if self.step is None else "both are"
            yield f"step, accuracy: {given} given; give one of them"
        if self.accuracy is None and self.string == "auto":
            yield (
                'string: "auto" is chosen by the requested accuracy; give accuracy instead of'
                " step, or choose the string"
            )

    @property
    def unsolved(self) -> list[str]:
        """Reasons why the exact engine does not support it; empty where it does."""
        reasons = []
        if self.string == "modal":
            reasons.append(
                'engine: "exact" has no string that moves by itself; use engine = "rigid" or'
                ' string = "spring"'
            )
        if self.joints is not None:
            reasons.append(
                'engine: "exact" has two angles for the arm, whose motors turn with their links'
                ' without friction; use engine = "rigid", or remove the table [joints]'
            )
        for part, has in (("bending", "two angles"), ("play", "an angle and a height")):
            if getattr(self, part) is not None:
                reasons.append(
                    'engine: "exact" solves one equation for the angle of a rigid key on a fixed'
                    f' pin, and a key with {part} has {has}; use engine = "rigid", or remove the'
                    f" table [{part}]"
                )
        return reasons

    @property
    def solvable(self) -> bool:
        """Whether the exact engine supports it."""
        return not self.unsolved

    def on_rig(self, rig: Rig) -> "Scene":
        """Return the scene with the level and engine that `auto` means on a rig; see `on_bench`.

        Raises:
            SceneError: As of `true_rig`.
        """
        return self.on_bench(self.true_rig(rig)) if self.plectrum == "auto" else self.with_engine()

    def on_bench(self, true: Rig) -> "Scene":
        """Return the scene with the level and engine that `auto` means on a simulated bench.

        The level stays `auto` if the choirs need different ones, see `with_engine` for the engine.
        """
        # Imported here because it loads the model, which a scene alone does not need.
        from sautereau.analysis.model.choirs import level_name

        level = level_name(true, self.plectrum)
        scene = self if " and " in level else self.model_copy(update={"plectrum": level})
        return scene.with_engine()

    def with_engine(self) -> "Scene":
        """Return the scene with the engine that `auto` means with a step.

        Of equal steps the exact engine's are more accurate and, compiled, 13 times as fast;
        without numba they take 8 times as long as those of the rigid bodies. With an accuracy
        the engine is left to `select_solver`.
        """
        if self.engine != "auto" or self.step is None:
            return self
        best = "exact" if self.solvable and find_spec("numba") else "rigid"
        return self.model_copy(update={"engine": best})

    def products(self, daq: Daq) -> dict[str, str]:
        """Return the product of each device of a rig, by name; a table may have further ones."""
        return self.card if isinstance(self.card, dict) else dict.fromkeys(daq.devices, self.card)

    def true_rig(self, rig: Rig) -> Rig:
        """Return the simulated bench: the rig with the scene's `truth` and `more_choirs`.

        Raises:
            SceneError: The scene has a part of which the rig has no values, or `truth` has a value
                that is wrong or has no effect.
        """
        if self.more_choirs is not None:
            rig = rig.model_copy(update={"more_choirs": self.more_choirs})
        rig, faults = self._with_truth(rig), []
        for number, jack in enumerate([rig.jack, *(choir.jack for choir in rig.more_choirs)]):
            at = f"more_choirs[{number - 1}].jack" if number else "jack"
            for part in ("tongue", "damper"):
                if getattr(self, part) and getattr(jack, part) is None:
                    faults.append(
                        f"rig {rig.name}: the scene has {part} = true, and the rig has no table"
                        f" [{at}.{part}]; add it, or set {part} = false in the scene"
                    )
        products = self.products(rig.daq)
        for channel in rig.daq.channels:
            key, device = f"daq.channels.{channel.name}", rig.daq.device_of(channel)
            if device not in products:
                faults.append(
                    f"rig {rig.name}: {key} is on the device {device}, and the scene's card has"
                    f" {', '.join(products)}; name one of them in {key}.device, or add it to card"
                )
                continue
            number = DEVICE_TYPES[products[device]].inputs
            if number and channel.terminal not in {f"ai{n}" for n in range(number)}:
                faults.append(
                    f"rig {rig.name}: {key}.terminal is {channel.terminal}, and a"
                    f" {products[device]} has {number} inputs from ai0 on; change the terminal, or"
                    " the scene's card"
                )
        if faults:
            raise SceneError("\n".join(faults))
        return rig

    def overridden(self, keys: Iterable[str]) -> list[str]:
        """Return those dotted keys of a rig of which the simulated bench has the scene's value."""
        choirs = "more_choirs." if self.more_choirs is not None else "\0"
        return [key for key in keys if key in self.truth or key.startswith(choirs)]

    def _with_truth(self, rig: Rig) -> Rig:
        try:
            true = with_values(rig, self.truth) if self.truth else rig
        except RigError as error:
            raise SceneError(f"[truth] of the scene: {error}") from error
        if faults := [f"[truth] of the scene: {fault}" for fault in self._truth_without_effect()]:
            raise SceneError("\n".join(faults))
        return true

    def _truth_without_effect(self) -> Iterator[str]:
        for key, value in self.truth.items():
            own = re.sub(r"^more_choirs\.\d+\.", "", key)  # of a further string, as of the first
            if idle := dict(without_effect({own: value}, TRUTH_ACTS_IF, self)):
                yield f"{key}: {idle[own]}"
            elif own.startswith(UNUSED):
                servo = "; the gains of its position loops are in the scene's table [servo]"
                yield (
                    f"{key}: no part of the stand-in depends on it; remove it"
                    f"{servo if key.startswith('arm.servo_') else ''}"
                )
            elif key == "key.press_arm" and self.finger == "servo":
                yield (
                    'key.press_arm: with finger = "servo" the fingertip is where the arm puts it,'
                    " so the value has no effect; change arm.base_x instead"
                )
            elif key.rpartition(".")[2] in SENSED and self.sensors is None:
                yield f"{key}: the sensors are ideal, so it has no effect; add [sensors]"
            elif not key.startswith(SIMULATED):
                yield (
                    f"{key}: the bench has it from the rig, so it has no effect here; change it in"
                    " the rig"
                )

    def as_wired(self, rig: Rig) -> Rig:
        """Return the rig with the calibrations of this scene's sensors.

        For ideal sensors the sources and assumed ranges of the changed values are removed.
        """
        if self.sensors is not None:
            return rig
        changed = {
            f"daq.channels.{i}.{name}": value
            for i in range(len(rig.daq.channels))
            for name, value in SENSED.items()
        }
        origins = {
            kind: {key: said for key, said in getattr(rig, kind).items() if key not in changed}
            for kind in ("assumed", "sources")
        }
        return with_values(rig, changed).model_copy(update=origins)


def load_scene(name: str | Path = "paper") -> Scene:
    """Load a scene from a TOML file, or a packaged one by its name.

    Raises:
        SceneError: Lists every fault of the file.
    """
    text, origin, _ = named_text(name, "sautereau.sim_backend.scenes", "scene", SceneError)
    return parse_scene(text, origin)


def current_scene(document: dict[str, Any]) -> dict[str, Any]:
    """Return the JSON document of a scene with its present keys, and its engine's present name.

    Args:
        document: As `Scene.model_dump_json` wrote it, also by an earlier version.
    """
    optional = {
        name: field.get_default(call_default_factory=True)
        for name, field in Scene.model_fields.items()
        if not field.is_required()
    }
    found = to_jsonable_python(optional) | {"engine": "rigid"} | document  # once the only engine
    return found | {"engine": _engine(found["engine"])}


def packaged_scenes() -> list[str]:
    """Return the names of the scenes that come with sautereau."""
    return packaged_names("sautereau.sim_backend.scenes")


def parse_scene(text: str, origin: str = "scene") -> Scene:
    """Build a scene from the text of a TOML file; ``origin`` names it in errors."""
    document = read_toml(text, origin, SceneError)
    refuse_other(document, "a scene", origin, SceneError)
    with validating(Scene, SceneError, origin, in_text(text)):
        return Scene.model_validate(document)
