"""The plan of a session: its presses in order, and where the operator must act."""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count, groupby
from pathlib import Path
from typing import Any

from pydantic import BaseModel, JsonValue

from sautereau.rig.faults import fault_list
from sautereau.rig.load import rig_document
from sautereau.rig.schema import Rig
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.plan_table import Row
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.press import Trajectory

MOST_PRESSES = 100_000
"""Largest number of presses of a session: a day of them at full speed."""
_MAY_CHANGE = {
    "controller": ("port", "verified", "verified_settings", "verified_on"),
    "daq": ("address",),
}
"""What may change before a session is resumed: where its devices are connected, and that the
controller was verified again."""


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
    """The presses of a session."""

    rig: Rig
    """The bench; the rows change its values."""
    rows: tuple[Row, ...]
    warm_up: int = 0
    """Presses before the first of each set-up of the instrument."""
    rest: float = 0.0
    """s, between presses."""
    scene: str = ""
    """Of the stand-in, as JSON text; empty on the hardware."""
    files: Mapping[str, str] | None = None
    """SHA-256 of the files that the presses use, by the role of each."""

    def __post_init__(self):
        faults = []
        if not self.rows or min(row.repeats for row in self.rows) < 1:
            faults.append("it has no press; request 1 or more")
        if (n := sum(row.repeats for row in self.rows) + self.warm_up) > MOST_PRESSES:
            faults.append(f"{n} presses, more than {MOST_PRESSES}; divide them into sessions")
        if self.warm_up < 0:
            faults.append(f"{self.warm_up} warm-up presses; request 0 or more")
        if not 0 <= self.rest < float("inf"):
            faults.append(f"a rest of {self.rest:g} s; give 0 s or more")
        if faults:
            raise RobotError(fault_list("session", faults))

    @property
    def set_ups(self) -> list[list[Place]]:
        """The presses in order, divided where the instrument changes."""
        numbers = count(1)
        divided = []
        own = {"press": self.rig.press}  # so that only the rest is compared
        indices = range(len(self.rows))
        for _, same in groupby(indices, lambda i: self.rows[i].rig.model_copy(update=own)):
            rows = list(same)
            places = [Place(next(numbers), rows[0], True) for _ in range(self.warm_up)]
            for row in rows:
                places += [Place(next(numbers), row, False) for _ in range(self.rows[row].repeats)]
            divided.append(places)
        return divided

    def document(self) -> dict[str, Any]:
        """Return the plan as a JSON document; equal plans give equal documents."""
        rows = [
            {"values": dict(row.values), "repeats": row.repeats, "notes": row.notes}
            for row in self.rows
        ]
        return {
            "presses": rows,
            "warm_up": self.warm_up,
            "rest": self.rest,
            "rig": comparable(rig_document(self.rig)),
            "scene": json.loads(self.scene) if self.scene else "the hardware",
            "files": dict(self.files or {}),
        }


class RigDocument(BaseModel, extra="allow"):
    """A rig or a part of it as JSON of a file holds it, for `comparable`."""

    controller: dict[str, JsonValue] = {}
    daq: dict[str, JsonValue] = {}


def comparable(document: dict[str, Any]) -> dict[str, Any]:
    """Remove what may change within a session from a rig as TOML holds it, and return it."""
    for section, names in _MAY_CHANGE.items():
        for name in names:
            document.get(section, {}).pop(name, None)
    return document


def plan_rows(rows: Sequence[Row], plan_one: Callable[[Rig], Trajectory]) -> list[Trajectory]:
    """Plan the press of every row, before the first is made.

    Args:
        rows: Of the plan.
        plan_one: Returns the press of a row's rig.

    Raises:
        RobotError: Lists every row whose press cannot be planned.
        TrajectoryError: The only press cannot be planned.
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
    """Return the SHA-256 of a file that presses use.

    Raises:
        RobotError: It cannot be read.
    """
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise RobotError(f"{path}: cannot be read: {error.strerror}; give its path") from error


def to_set(rig: Rig, set_before: Mapping[str, Any], row: Row) -> dict[str, Any]:
    """Return what the operator must set before a row's presses, by the rig's dotted key.

    Args:
        rig: Of the session.
        set_before: Current settings that differ from the rig.
        row: Of the next presses; settings that it does not change return to the rig's.
    """
    document = rig_document(rig)
    needed = {}
    for key in dict.fromkeys([*set_before, *row.set_up]):
        own: Any = document
        for part in key.split("."):
            own = own[part]
        needed[key] = row.set_up.get(key, own)
    return {key: value for key, value in needed.items() if set_before.get(key) != value}
