"""Random cases of the stability map."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.extremes import case_scenes as scenes
from sautereau.rig.schema import Rig
from sautereau.sim_backend.parts import Bending, Play
from sautereau.sim_backend.scene import Scene


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


def random_cases(rig: Rig, n: int, seed: int = 0) -> Iterator[scenes.Case]:
    """Yield cases with all parameters drawn at random, each over its complete range."""
    dice = _Dice(np.random.default_rng(seed))
    for i in range(n):
        values = _random_bench(rig, dice)
        scene, speed = _random_drive(rig, scenes.ENGINES[i % 2], dice)
        yield scenes.Case(f"random {i}", _random_parts(rig, scene, dice), values | speed)


def _random_bench(rig: Rig, dice: _Dice) -> scenes.Values:
    return {
        **scenes.mass_ratio(rig, dice.log(1, 1e4)),
        **scenes.stiffness_times(rig, dice.log(1e-3, 1e3), dice.log(1e-3, 1e3)),
        "plectrum.overlap": f"{dice.log(1e-5, 2e-3)!r} m",
        "key.pivot_coulomb_friction": f"{dice.maybe(dice.log(1e-5, 1e-1))!r} N m",
        "jack.register_friction": f"{dice.maybe(dice.log(1e-4, 1.0))!r} N",
    }


def _random_drive(rig: Rig, engine: scenes.Engine, dice: _Dice) -> tuple[Scene, scenes.Values]:
    """Return a scene with any finger, and the changes of the bench for the finger's speed."""
    friction, felt, tongue, damper = (dice.coin() for _ in range(4))
    step, finger = dice.log(2e-5, 2e-3), str(dice.rng.choice(["push", "ideal", "servo"]))
    speed: scenes.Values = {}
    if finger == "push":
        force = dice.log(0.05, 100)
        scene = scenes.push_scene(
            engine, step, force=force, duration=0.1, friction=friction, felt=felt
        )
    else:
        scene = scenes.ideal_scene(engine, step, friction=friction, felt=felt)
        speed = scenes.at_speed(rig, dice.log(0.02, 1.0))
    if finger == "servo":
        scene = scenes.servo_scene(scene)
    return scenes.changed(scene, tongue=tongue, damper=damper), speed


def _random_parts(rig: Rig, scene: Scene, dice: _Dice) -> Scene:
    """Return a scene with gravity, choirs, pad, and a part that only `rigid` has, at random."""
    parts: dict[str, Any] = {
        "gravity": dice.maybe(dice.log(1.0, 100.0)),
        "more_choirs": scenes.more_choirs(rig)[: dice.rng.integers(3)],
    }
    if scene.finger != "push" and dice.coin():
        parts["fingertip"] = scenes.pad_of(dice.log(1e3, 1e5), dice.maybe(dice.log(0.1, 20.0)))
    if scene.engine == "rigid":
        part = str(dice.rng.choice(["none", "modal", "bending", "play"]))
        if part == "modal":
            parts["string"] = "modal"
        elif part == "bending":
            parts["bending"] = Bending.model_construct(frequency=dice.log(150.0, 800.0))
        elif part == "play" and ("fingertip" in parts or scene.finger != "ideal"):
            stiffness, damping = dice.log(5e3, 1e6), dice.maybe(5.0)
            parts["play"] = Play.model_construct(stiffness=stiffness, damping=damping)
    return scenes.changed(scene, **parts)
