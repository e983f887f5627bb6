"""Speed of the jack while a string is held: RMS errors before and after learning."""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.figures import BenchmarkFault
from benchmarks.learning import Learned, learned_on
from benchmarks.spinet import SPINET
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.schema import Rig
from sautereau.sim_backend.parts import Joints
from sautereau.sim_backend.scene import Scene, load_scene
from sautereau.trajectory.learning import IMPROVEMENT

PRESSES = 4  # Of each learning
SEED = 2  # With 0, the plectrum of the scene transient loses its string, which still vibrates
LIMIT = 1.0  # %, or the floor where that is larger
HEAD = (
    "| rig and scene | planned | predicted | first press | learned | learned with feed-forward |"
    " floor | 1 % or floor |\n|---|---|---|---|---|---|---|---|"
)
QUICK = {
    "controller.timeout": "600 s",  # the stand-in answers after its motion
    "controller.watchdog_period": "5 s",  # for a busy machine, in real time
    "arm.approach_speed": "5 rad/s",
    "press.approach_speed": "0.3 m/s",
}
"""Values of a rig that do not change a press, for a short way to the key."""
FRICTION = {
    "dry_friction": ["5 mN m", "2 mN m"],
    "viscous_friction": ["0.02 N m s/rad", "0.01 N m s/rad"],
}
BACKLASH = {"backlash": ["0.02 deg", "0.02 deg"]}
ROTORS = {"arm.rotor_inertias": ["1e-3 kg m^2", "3e-4 kg m^2"]}


@dataclass(frozen=True)
class Row:
    """RMS errors of the jack speed relative to the plan, in %; NaN where there is none."""

    what: str
    planned: float
    """By rounding of the plan to encoder counts, over the cruise."""
    predicted: float
    """Of the first press by stiffness and damping of the position loops."""
    first: float
    learned: float
    pushed: float
    floor: float
    """Of the better one, by rounding, by what differs from press to press and by what is faster
    than a correction."""

    @property
    def missed(self) -> bool:
        """Whether neither learning reaches the limit, nor its floor but for an improvement that
        learning does not count as one."""
        return (1 - IMPROVEMENT) * min(self.learned, self.pushed) > max(LIMIT, self.floor)

    def __str__(self) -> str:
        errors = self.planned, self.predicted, self.first, self.learned, self.pushed, self.floor
        cells = " | ".join("-" if e != e else f"{e:.3g} %" for e in errors)
        return f"| {self.what} | {cells} | {'MISSED' if self.missed else 'reached'} |"


def run() -> list[Row]:
    """Return the errors of every rig and scene."""
    return [_row(what, *case) for what, case in cases().items()]


def cases() -> dict[str, tuple[Rig, Scene, bool]]:
    """Return rig and scene of each case, and whether simulated time follows real time."""
    rig, paper = load_rig(), load_scene("paper")

    def counts(number: int) -> Rig:
        limit = {"controller.position_error_limit": number // 100 + 100}
        return with_values(rig, {"arm.counts_per_revolution": number} | limit)

    def servo(stiffness: float) -> Scene:
        if paper.servo is None:
            raise BenchmarkFault("the scene paper has no servo")
        soft = paper.servo.model_copy(update={"stiffness": (stiffness, stiffness)})
        return paper.model_copy(update={"servo": soft})

    def joints(table: dict[str, Any]) -> Scene:
        return paper.model_copy(update={"joints": Joints.model_validate(table)})

    choirs = load_scene("two-choirs").more_choirs
    heavy = paper.model_copy(update={"truth": {"jack.mass": "12 g"}})
    repeats = with_values(rig, {"controller.home_tolerance": 1000})
    found = {
        "paper": (rig, paper),
        "paper, in real time": (rig, paper),
        "two choirs, 0.072 m/s": (rig.model_copy(update={"more_choirs": choirs}), paper),
        "spinet, two choirs, 0.03 m/s": (SPINET, paper),
        "position loops of 9 N m/rad": (rig, servo(9.0)),
        "position loops of 3 N m/rad": (rig, servo(3.0)),
        "jack of 12 g, 6 g in the rig": (rig, heavy),
        "encoders of 262,144 counts": (counts(262_144), paper),
        "encoders of 20,000 counts": (counts(20_000), paper),
        "joints with dry and viscous friction": (repeats, joints(FRICTION)),
        "joints with 0.02 deg of backlash": (with_values(rig, ROTORS), joints(BACKLASH)),
        "scene ideal": (rig, load_scene("ideal")),
        "scene return": (rig, load_scene("return")),
        "scene transient": (rig, load_scene("transient")),
    }
    return {what: (*case, "real time" in what) for what, case in found.items()}


def _row(what: str, rig: Rig, scene: Scene, paced: bool) -> Row:
    values: dict[str, Any] = dict(QUICK)
    if scene.servo is not None:
        values["arm.servo_stiffness"] = [f"{k} N m/rad" for k in scene.servo.stiffness]
        values["arm.servo_damping"] = [f"{c} N m s/rad" for c in scene.servo.damping]
    rig = with_values(rig, values)
    with tempfile.TemporaryDirectory() as folder:
        bare, pushed = (
            learned_on(
                rig, scene, PRESSES, Path(folder) / str(push), seed=SEED, paced=paced, push=push
            )
            for push in (False, True)
        )
    better = min(bare, pushed, key=_best)
    return Row(
        what,
        100 * bare.trajectory.cruise.rms_error,
        100 * (bare.trajectory.loaded_speed_error or float("nan")),
        100 * bare.held[0],
        100 * _best(bare),
        100 * _best(pushed),
        100 * better.floor,
    )


def _best(learned: Learned) -> float:
    """Return the error while a string is held, of the best press as learning judges."""
    return learned.held[learned.errors.index(min(learned.errors))]
