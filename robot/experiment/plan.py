"""The plan of a session: which presses, in which order, and where the operator must act."""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count, groupby
from pathlib import Path
from typing import Any

from sautereau.rig.faults import fault_list
from sautereau.rig.load import rig_document
from sautereau.rig.schema import Rig
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.plan_table import Row
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.press import Trajectory

_ADDRESSES = (("controller", "port"), ("daq", "address"))
"""What may change while a session rests: where its devices are plugged in."""


@dataclass(frozen=True)
class Place:
    """One press in a session's plan."""

    number: int
    """From 1."""
    row: int
    """Index of its row."""
    warm_up: bool


@dataclass(frozen=True)
class Plan:
    """What a session makes."""

    rig: Rig
    """The bench, which the rows change."""
    rows: tuple[Row, ...]
    warm_up: int = 0
    """Presses before the first of every set-up of the instrument."""
    rest: float = 0.0
    """s, between presses."""
    scene: str = ""
    """Of the stand-in, as JSON text; empty on the hardware."""
    files: Mapping[str, str] | None = None
    """SHA-256 of the files that the presses follow, by what they are."""

    def __post_init__(self):
        faults = []
        if not self.rows or min(row.repeats for row in self.rows) < 1:
            faults.append("it has no press; ask for 1 or more")
        if self.warm_up < 0:
            faults.append(f"{self.warm_up} presses for warming up; ask for 0 or more")
        if not 0 <= self.rest < float("inf"):
            faults.append(f"a rest of {self.rest:g} s; give 0 s or more")
        if faults:
            raise RobotError(fault_list("session", faults))

    @property
    def set_ups(self) -> list[list[Place]]:
        """The presses in order, parted where the instrument changes."""
        numbers = count(1)
        parted = []
        indices = range(len(self.rows))
        for _, same in groupby(indices, lambda i: _instrument(self.rows[i].rig, self.rig)):
            rows = list(same)
            places = [Place(next(numbers), rows[0], True) for _ in range(self.warm_up)]
            for row in rows:
                places += [Place(next(numbers), row, False) for _ in range(self.rows[row].repeats)]
            parted.append(places)
        return parted

    @property
    def presses(self) -> int:
        """How many there are, for warming up and in earnest."""
        return sum(map(len, self.set_ups))

    def document(self) -> dict[str, Any]:
        """Return the plan as JSON holds it, the same for the same plan."""
        rig = rig_document(self.rig)
        for section, name in _ADDRESSES:
            del rig[section][name]
        rows = [
            {"values": dict(row.values), "repeats": row.repeats, "notes": row.notes}
            for row in self.rows
        ]
        return {
            "presses": rows,
            "warm_up": self.warm_up,
            "rest": self.rest,
            "rig": rig,
            "scene": json.loads(self.scene) if self.scene else "the hardware",
            "files": dict(self.files or {}),
        }


def plan_rows(rows: Sequence[Row], plan_one: Callable[[Rig], Trajectory]) -> list[Trajectory]:
    """Plan the press of every row, before any is made.

    Args:
        rows: Of the plan.
        plan_one: Plans the press of a row's rig.

    Raises:
        RobotError: Lists every row whose press cannot be made.
        TrajectoryError: The only press cannot be made.
    """
    planned, faults = [], []
    for row in rows:
        try:
            planned.append(plan_one(row.rig))
        except (TrajectoryError, RobotError) as error:
            if row.line is None:
                raise
            faults.append(f"line {row.line}: {error}")
    if faults:
        raise RobotError(fault_list("plan table", faults))
    return planned


def digest(path: Path) -> str:
    """Return the SHA-256 of a file that presses follow.

    Raises:
        RobotError: It cannot be read.
    """
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise RobotError(f"{path}: cannot be read: {error.strerror}; give its path") from error


def _instrument(rig: Rig, base: Rig) -> Rig:
    """Return a bench whose way to press is that of another, so that all else compares."""
    return rig.model_copy(update={"press": base.press})


def to_set(rig: Rig, told: Mapping[str, Any], row: Row) -> dict[str, Any]:
    """Return what the operator has to set before a row's presses, by the rig's dotted key.

    Args:
        rig: The session's.
        told: What was set before, where it differs from the rig.
        row: Whose presses come next; what it leaves as the rig has it is set back.
    """
    document = rig_document(rig)
    wanted = {}
    for key in dict.fromkeys([*told, *row.set_up]):
        own: Any = document
        for part in key.split("."):
            own = own[part]
        wanted[key] = row.set_up.get(key, own)
    return {key: value for key, value in wanted.items() if told.get(key) != value}
