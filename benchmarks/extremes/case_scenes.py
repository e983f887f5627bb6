"""Scenes and changes of the bench of which the cases of the stability map are made."""

from dataclasses import dataclass, field
from typing import Any, Literal

from sautereau.rig.instrument import Choir
from sautereau.rig.schema import Rig
from sautereau.sim_backend.parts import Fingertip
from sautereau.sim_backend.scene import Scene, load_scene

Engine = Literal["rigid", "exact"]
ENGINES: tuple[Engine, ...] = ("rigid", "exact")
Values = dict[str, str | float]
"""TOML values of a rig by dotted key."""

MIDDLE, SLOW = 100e-6, 500e-6
"""s, steps of the cases that vary other parameters, and of long ones."""


@dataclass(frozen=True)
class Case:
    """One scene on one bench."""

    name: str
    scene: Scene
    values: Values = field(default_factory=dict)
    """Values in which its bench differs from the rig."""


def more_choirs(rig: Rig) -> tuple[Choir, ...]:
    """Return two choirs with other arms and clearances than the rig's."""
    return tuple(
        Choir.model_construct(
            jack_arm=rig.key.jack_arm + 0.012 * n,
            jack=rig.jack.model_copy(update={"string_clearance": (1.5 - 0.4 * n) * 1e-3}),
            plectrum=rig.plectrum,
            string=rig.string,
        )
        for n in (1, 2)
    )


def pad_of(stiffness: float, damping: float = 0.0) -> Fingertip:
    """Return a pad of a stiffness [N/m] and a damping [N s/m]."""
    return Fingertip.model_construct(stiffness=stiffness, damping=damping)


def changed(scene: Scene, **changes: Any) -> Scene:
    """Return a scene with some fields replaced, without validation."""
    return scene.model_copy(update=changes)


def at_speed(rig: Rig, speed: float) -> Values:
    """Return the changes for a jack speed [m/s] that is reached within the same rise."""
    press, times = rig.press, max(speed / rig.press.jack_speed, 1.0)
    return {
        "press.jack_speed": f"{speed!r} m/s",
        "press.run_up_acceleration": f"{press.run_up_acceleration * times**2!r} m/s^2",
        "press.run_up_jerk": f"{press.run_up_jerk * times**3!r} m/s^3",
        "press.run_down_acceleration": f"{press.run_down_acceleration * times**2!r} m/s^2",
        "press.run_down_jerk": f"{press.run_down_jerk * times**3!r} m/s^3",
        **LIMITLESS,
    }


def mass_ratio(rig: Rig, ratio: float) -> Values:
    """Return the changes for a ratio of the key's inertia to its jack's.

    The key's static gravity moment keeps its ratio to that of the jack.
    """
    key, jack = rig.key, rig.jack
    mass = key.inertia / key.jack_arm**2 / ratio
    heaviness = key.gravity_moment * mass / jack.mass
    return {"jack.mass": f"{mass!r} kg", "key.gravity_moment": f"{heaviness!r} N m"}


def stiffness_times(rig: Rig, string: float = 1.0, plectrum: float = 1.0) -> Values:
    """Return the changes that multiply the stiffnesses of the string and of the plectrum."""
    return {
        "string.tension": f"{rig.string.tension * string!r} N",
        "plectrum.youngs_modulus": f"{rig.plectrum.youngs_modulus * plectrum!r} Pa",
    }


LIMITLESS: Values = {
    "arm.speed_limit": "1e3 rad/s",
    "arm.acceleration_limit": "1e6 rad/s^2",
    "arm.jerk_limit": "1e10 rad/s^3",
    "arm.torque_limit": "1e4 N m",
}
"""An ideal finger's arm needs no limits."""


def push_scene(
    engine: Engine,
    step: float = MIDDLE,
    *,
    force: float = 1.2,
    duration: float = 0.04,
    rest: float = 0.0,
    friction: bool = True,
    felt: bool = True,
) -> Scene:
    """Return a scene with a push of a force [N] for a duration [s], and a rest [s] after it."""
    push = {"force": f"{force!r} N", "duration": f"{duration!r} s", "rest": f"{rest!r} s"}
    return _scene(engine, step, friction, felt, finger="push", push=push)


def ideal_scene(
    engine: Engine, step: float = MIDDLE, *, friction: bool = True, felt: bool = True
) -> Scene:
    """Return a scene with an ideal finger."""
    return _scene(engine, step, friction, felt, finger="ideal")


def servo_scene(ideal: Scene) -> Scene:
    """Return a scene with the packaged scene's finger instead of the ideal one."""
    return changed(ideal, finger="servo", servo=load_scene("paper").servo)


def _scene(engine: Engine, step: float, friction: bool, felt: bool, **finger: Any) -> Scene:
    document = {
        "plectrum": "elastica",
        "string": "spring",
        "friction": friction,
        "felt": felt,
        "engine": engine,
        "step": f"{step!r} s",
        "iterations": 30,
    }
    return Scene.model_validate(document | finger)
