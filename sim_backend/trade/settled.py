"""A scene with nothing left to choose."""

import math
from dataclasses import dataclass

from sautereau.sim_backend.accuracy import Accuracy
from sautereau.sim_backend.physics.observation import Errors
from sautereau.sim_backend.scene import Scene
from sautereau.sim_backend.trade.ladder import LOST


@dataclass(frozen=True)
class Settled:
    """A scene with nothing left to choose, and how accurate it is by its own measurement."""

    scene: Scene
    """With a step, an engine, a level and a string."""
    asked: Accuracy | None
    """None where the scene gave a step."""
    errors: Errors
    """At most, of this scene's drive, against the scene solved exactly."""
    real_time_factor: float
    """1, simulated over real time, by a fixed rule and not by a clock."""

    def __str__(self) -> str:
        scene = self.scene
        asked = f" for the {self.asked} asked" if self.asked else ""
        return (
            f"settled on engine {scene.engine}, plectrum {scene.plectrum}, string {scene.string},"
            f" steps of {micro(scene.step or 0.0)}: {reached(self.errors)}{asked};"
            f" about {self.real_time_factor:.2g} x real time"
        )


def share(found: Errors, asked: Accuracy) -> float:
    """Return the error [1] over the one asked for."""
    if asked.time is not None:
        return found.time / asked.time
    return found.force / (asked.force or math.inf)


def meets(found: Errors, asked: Accuracy) -> bool:
    return found != LOST and share(found, asked) <= 1


def reached(found: Errors) -> str:
    if not math.isfinite(found.time):
        return "events that come and go with the step"
    return f"events to {found.time * 1e6:.2g} us and forces to {100 * found.force:.2g} %"


def micro(seconds: float) -> str:
    return f"{seconds * 1e6:.4g} us"
