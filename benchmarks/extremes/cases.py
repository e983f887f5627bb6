"""The grid of the stability map: cases along each parameter."""

from collections.abc import Iterator

from benchmarks.extremes.case_scenes import (
    ENGINES,
    LIMITLESS,
    MIDDLE,
    SLOW,
    Case,
    Engine,
    Values,
    at_speed,
    changed,
    ideal_scene,
    mass_ratio,
    more_choirs,
    pad_of,
    push_scene,
    servo_scene,
    stiffness_times,
)
from sautereau.rig.schema import Rig
from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.parts import Bending, Play

STEPS = (1e-6, 1e-5, 1e-4, 5e-4, 2e-3)
"""s."""
SPEEDS = (0.005, 0.02, 0.072, 0.3, 1.0)
"""m/s, of the jack."""
FORCES = (0.01, 0.3, 1.2, 10.0, 100.0)
"""N, of a push."""
MASS_RATIOS = (1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, 1e2, 1e3, 1e4)
"""Dimensionless, the key's inertia over the jack's about the pin."""
STIFFNESSES = (1e-3, 0.1, 10.0, 1e3)
"""Dimensionless factors on the rig's."""
OVERLAPS = (0.01e-3, 0.1e-3, 0.5e-3, 2e-3)
"""m."""


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
