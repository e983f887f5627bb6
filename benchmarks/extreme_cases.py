"""Cases of the stability map: along each parameter, and at random."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from sautereau.rig.instrument import Choir
from sautereau.rig.schema import Rig
from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.parts import Bending, Fingertip, Play
from sautereau.sim_backend.scene import Scene, load_scene

Engine = Literal["rigid", "exact"]
ENGINES: tuple[Engine, ...] = ("rigid", "exact")
Values = dict[str, str | float]  # TOML values of a rig by dotted key

MIDDLE, SLOW = 100e-6, 500e-6  # s, steps of the cases that vary other parameters, and of long ones


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
    "arm.tilt_limit": "180 deg",
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
    document: dict[str, Any] = {
        "plectrum": "elastica",
        "string": "spring",
        "friction": friction,
        "felt": felt,
        "engine": engine,
        "step": f"{step!r} s",
    }
    if engine != "exact":
        document["iterations"] = 30
    return Scene.model_validate(document | finger)


STEPS = (1e-6, 1e-5, 1e-4, 5e-4, 2e-3)  # s
SPEEDS = (0.005, 0.02, 0.072, 0.3, 1.0)  # m/s, of the jack
FORCES = (0.01, 0.3, 1.2, 10.0, 100.0)  # N, of a push
MASS_RATIOS = (1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, 1e2, 1e3, 1e4)
"""Dimensionless, the key's inertia over the jack's about the pin."""
STIFFNESSES = (1e-3, 0.1, 10.0, 1e3)  # Dimensionless factors on the rig's
OVERLAPS = (0.01e-3, 0.1e-3, 0.5e-3, 2e-3)  # m


def grid(rig: Rig) -> Iterator[Case]:
    """Yield the cases of each parameter alone, for both engines."""
    for engine in ENGINES:
        for step in STEPS:
            yield Case(f"push, step {step * 1e6:g} us", push_scene(engine, step))
        for step in STEPS[2:]:
            yield Case(f"ideal, step {step * 1e6:g} us", ideal_scene(engine, step))
        for force in FORCES:
            yield Case(f"push of {force:g} N", push_scene(engine, force=force))
        for speed in SPEEDS:
            step = MIDDLE if speed > SPEEDS[0] else SLOW
            yield Case(f"ideal at {speed:g} m/s", ideal_scene(engine, step), at_speed(rig, speed))
        for ratio in MASS_RATIOS:
            force = min(100.0, 1.2 + 0.5 / ratio if ratio < 1 else 1.2)  # four times its jack's
            yield Case(
                f"mass ratio {ratio:g}", push_scene(engine, force=force), mass_ratio(rig, ratio)
            )
            yield Case(f"ideal, mass ratio {ratio:g}", ideal_scene(engine), mass_ratio(rig, ratio))
        for times in STIFFNESSES:
            for part in ("string", "plectrum"):
                values = stiffness_times(rig, **{part: times})
                yield Case(f"{part} x {times:g}", push_scene(engine, force=3.0), values)
        for overlap in OVERLAPS:
            yield Case(
                f"overlap {overlap * 1e3:g} mm",
                push_scene(engine, force=2.0),
                {"plectrum.overlap": f"{overlap!r} m"},
            )
        yield from _families(rig, engine)
        yield from _frictions(engine)
        yield from _stops(rig, engine)


def _families(rig: Rig, engine: Engine) -> Iterator[Case]:
    """Yield cases with the parts that a scene may have beside those of the others."""
    push, ideal = push_scene(engine), ideal_scene(engine)
    servo = servo_scene(ideal)
    more, pad = more_choirs(rig), pad_of(3e4, 5.0)
    for gravity in (0.0, 1.62, 100.0):
        for name, scene in (("push", push), ("ideal", ideal), ("servo", servo)):
            yield Case(f"{name}, gravity {gravity:g} m/s^2", changed(scene, gravity=gravity))
    for name, scene in (("push", push), ("ideal", ideal), ("servo", servo)):
        yield Case(f"{name}, two choirs", changed(scene, more_choirs=more[:1]))
        yield Case(f"{name}, three choirs", changed(scene, more_choirs=more))
        returns = scene if scene.push is None else push_scene(engine, duration=0.03, rest=0.15)
        yield Case(f"{name}, tongue and damper", changed(returns, tongue=True, damper=True))
    for step in (MIDDLE, SLOW, STEPS[-1]):
        yield Case(f"servo, step {step * 1e6:g} us", changed(servo, step=step))
    for name, scene in (("ideal", ideal), ("servo", servo)):
        yield Case(f"{name} with a pad", changed(scene, fingertip=pad))
        yield Case(f"{name} with a soft pad", changed(scene, fingertip=pad_of(1e3)))
    if engine == "exact":
        return
    bending = Bending.model_validate({"frequency": "400 Hz"})
    play = Play.model_validate({"stiffness": "200 kN/m", "damping": "5 N s/m"})
    deep = play.model_copy(update={"stiffness": 5e3, "clearance": 0.05e-3})
    for name, scene in (("push", push), ("ideal with a pad", changed(ideal, fingertip=pad))):
        yield Case(f"{name}, bending", changed(scene, bending=bending))
        yield Case(f"{name}, play", changed(scene, play=play))
        yield Case(f"{name}, modal string", changed(scene, string="modal"))
    yield Case("servo, play", changed(servo, play=play))
    yield Case("servo, play down to the rail", changed(servo, play=deep))


def _frictions(engine: Engine) -> Iterator[Case]:
    for friction in (False, True):
        word = "with" if friction else "without"
        yield Case(f"push {word} friction", push_scene(engine, friction=friction))
        yield Case(f"ideal {word} friction", ideal_scene(engine, friction=friction))
    for moment, force in ((0.0, 1.0), (0.1, 0.0), (0.1, 1.0)):
        values: Values = {
            "key.pivot_coulomb_friction": f"{moment!r} N m",
            "jack.register_friction": f"{force!r} N",
        }
        name = f"dry friction of {moment:g} N m and {force:g} N"
        yield Case(f"push, {name}", push_scene(engine, force=2.5), values)
        yield Case(f"ideal, {name}", ideal_scene(engine), values)
    viscous: Values = {"key.pivot_viscous_friction": "1.0 N*m*s/rad"}
    yield Case("viscous friction x 10000", push_scene(engine, force=2.0), viscous)


def _stops(rig: Rig, engine: Engine) -> Iterator[Case]:
    balance = rig.jack.mass * GRAVITY * rig.key.jack_arm
    for name, ratio in (("unweighted", 0.0), ("nearly balanced", 0.999), ("balanced", 1.0)):
        values: Values = {"key.gravity_moment": f"{ratio * balance!r} N m"}
        yield Case(f"key {name}", push_scene(engine), values)
        yield Case(f"key {name}, not pressed", push_scene(engine, force=0.0), values)
    yield Case("key on its felt", push_scene(engine, duration=0.15))
    yield Case("key thrown on its felt", push_scene(engine, force=20.0, duration=0.1))
    hard: Values = {"key.felt_stiffness": "1e6 N/m", "key.felt_damping": "0 N*s/m"}
    yield Case("key on a hard felt", push_scene(engine, duration=0.1), hard)
    yield Case("key falls on its rail", push_scene(engine, duration=0.02, rest=0.15))
    yield Case("key thrown past its stop", push_scene(engine, force=5.0, duration=0.1, felt=False))
    fast: Values = {
        "press.return_acceleration": "30 m/s^2",
        "press.return_speed": "0.5 m/s",
        "press.run_down_acceleration": "30 m/s^2",
        "press.run_down_jerk": "1e4 m/s^3",
        **LIMITLESS,
    }
    yield Case("finger leaves the key", ideal_scene(engine), fast)


@dataclass(frozen=True)
class _Dice:
    """Parameters at random."""

    rng: np.random.Generator

    def log(self, low: float, high: float) -> float:
        """Return a number that is uniform in its logarithm."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def coin(self) -> bool:
        return bool(self.rng.integers(2))

    def maybe(self, value: float) -> float:
        """Return the value or 0."""
        return value if self.coin() else 0.0


def random_cases(rig: Rig, n: int, seed: int = 0) -> Iterator[Case]:
    """Yield cases with all parameters drawn at random, each over its complete range."""
    dice = _Dice(np.random.default_rng(seed))
    for i in range(n):
        values = _random_bench(rig, dice)
        scene, speed = _random_drive(rig, ENGINES[i % 2], dice)
        yield Case(f"random {i}", _random_parts(rig, scene, dice), values | speed)


def _random_bench(rig: Rig, dice: _Dice) -> Values:
    return {
        **mass_ratio(rig, dice.log(1, 1e4)),
        **stiffness_times(rig, dice.log(1e-3, 1e3), dice.log(1e-3, 1e3)),
        "plectrum.overlap": f"{dice.log(1e-5, 2e-3)!r} m",
        "key.pivot_coulomb_friction": f"{dice.maybe(dice.log(1e-5, 1e-1))!r} N m",
        "jack.register_friction": f"{dice.maybe(dice.log(1e-4, 1.0))!r} N",
    }


def _random_drive(rig: Rig, engine: Engine, dice: _Dice) -> tuple[Scene, Values]:
    """Return a scene with any finger, and the changes of the bench for the finger's speed."""
    friction, felt, tongue, damper = (dice.coin() for _ in range(4))
    step, finger = dice.log(2e-5, 2e-3), str(dice.rng.choice(["push", "ideal", "servo"]))
    speed: Values = {}
    if finger == "push":
        force = dice.log(0.05, 100)
        scene = push_scene(engine, step, force=force, duration=0.1, friction=friction, felt=felt)
    else:
        scene = ideal_scene(engine, step, friction=friction, felt=felt)
        speed = at_speed(rig, dice.log(0.02, 1.0))
    if finger == "servo":
        scene = servo_scene(scene)
    return changed(scene, tongue=tongue, damper=damper), speed


def _random_parts(rig: Rig, scene: Scene, dice: _Dice) -> Scene:
    """Return a scene with gravity, choirs, pad, and a part that only `rigid` has, at random."""
    parts: dict[str, Any] = {
        "gravity": dice.maybe(dice.log(1.0, 100.0)),
        "more_choirs": more_choirs(rig)[: dice.rng.integers(3)],
    }
    if scene.finger != "push" and dice.coin():
        parts["fingertip"] = pad_of(dice.log(1e3, 1e5), dice.maybe(dice.log(0.1, 20.0)))
    if scene.engine == "rigid":
        part = str(dice.rng.choice(["none", "modal", "bending", "play"]))
        if part == "modal":
            parts["string"] = "modal"
        elif part == "bending":
            parts["bending"] = Bending.model_construct(frequency=dice.log(150.0, 800.0))
        elif part == "play" and ("fingertip" in parts or scene.finger != "ideal"):
            stiffness, damping = dice.log(5e3, 1e6), dice.maybe(5.0)
            parts["play"] = Play.model_construct(stiffness=stiffness, damping=damping)
    return changed(scene, **parts)
