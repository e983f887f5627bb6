"""The plan of a session: its presses, where the operator must act, and the changes of a plan."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, JsonValue

from sautereau.daq.file.provenance import check_recordable
from sautereau.rig import disk
from sautereau.rig.document import comparable, rig_document
from sautereau.rig.faults import fault_list
from sautereau.rig.schema import Rig
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.plan_table import MOST_PRESSES, Row

LEARNING = "from these presses"
"""In the place of a file's SHA-256: the correction of a session that learns it."""
MOST_LISTED = 8  # Differences that one message lists
_ABSENT = "nothing"


@dataclass(frozen=True)
class Plan:
    """The presses of a session."""

    rig: Rig
    """The bench; the rows change its values."""
    rows: tuple[Row, ...] | None
    """None if they are known only as the plan runs."""
    warm_up: int = 1
    """Presses before each one that starts from a lift; they are recorded, and no part of it."""
    rest: float = 0.0
    """s, between presses."""
    scene: str = ""
    """Scene of the stand-in as JSON text; empty on the hardware."""
    files: Mapping[str, str] | None = None
    """SHA-256 of the files that the presses use, by the role of each."""

    def __post_init__(self):
        faults = []
        rows = self.rows
        if rows is not None and (not rows or min(row.repeats for row in rows) < 1):
            faults.append("it has no press; request 1 or more")
        if (n := sum(row.repeats for row in rows or ()) + self.warm_up) > MOST_PRESSES:
            faults.append(f"{n} presses, more than {MOST_PRESSES}; divide them into sessions")
        if self.warm_up < 0:
            faults.append(f"{self.warm_up} warm-up presses; request 0 or more")
        if not 0 <= self.rest < float("inf"):
            faults.append(f"a rest of {self.rest:g} s; give 0 s or more")
        if faults:
            raise RobotError(fault_list("session", faults))
        for row in rows or ():
            self.check(row)

    def check(self, row: Row) -> None:
        """Refuse a row whose recordings could not be read.

        Raises:
            RecordingError: As of `check_recordable`.
        """
        check_recordable(row.rig, row.notes, self.scene)

    @property
    def total(self) -> int | None:
        """Number of presses; None if it is not known."""
        return None if self.rows is None else sum(row.repeats for row in self.rows)

    def document(self) -> dict[str, Any]:
        """Return the plan as a JSON document; equal plans give equal documents."""
        return {
            "presses": [row.document() for row in self.rows or ()],
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


def instrument_of(rig: Rig) -> Rig:
    """Return a rig for comparison with others on which the same instrument is set up."""
    return rig.model_copy(update={"press": None})


def digest(path: Path) -> str:
    """Return the SHA-256 of a file that presses use.

    Raises:
        RobotError: It cannot be read.
    """
    try:
        return disk.digest(path)
    except OSError as error:
        raise RobotError(
            f"{path}: cannot be read: {disk.why_unreadable(error)}; check its name"
        ) from error


def to_set(rig: Rig, set_before: Mapping[str, Any], row: Row) -> dict[str, Any]:
    """Return what the operator must set before a row's presses, by the rig's dotted key.

    Args:
        set_before: Current settings that differ from the rig.
        row: Row of the next presses; settings that it does not change return to the rig's.
    """
    document = rig_document(rig)
    needed = {}
    for key in dict.fromkeys([*set_before, *row.set_up]):
        own: Any = document
        for part in key.split("."):
            own = own[part]
        needed[key] = row.set_up.get(key, own)
    return {key: value for key, value in needed.items() if set_before.get(key) != value}


def check_same(folder: Path, started: Mapping[str, Any], asked: Mapping[str, Any]) -> None:
    """Refuse another plan than that with which a session started.

    Raises:
        RobotError: Names the differences, and the way out.
    """
    found = list(differences(started, asked))
    if not found:
        return
    more = f"\n  and {len(found) - MOST_LISTED} more" if len(found) > MOST_LISTED else ""
    raise RobotError(
        f"session folder {folder}: its session was started with another plan\n  "
        + "\n  ".join(found[:MOST_LISTED])
        + more
        + "\nto continue that session, give its original command; for a new session, another --out"
    )


def differences(started: Any, asked: Any, at: str = "") -> Iterator[str]:
    """Yield the differences of two JSON documents, by dotted key, with both values.

    A key that is missing is one without a value.
    """
    if isinstance(started, list) and isinstance(asked, list):
        started, asked = (dict(enumerate(values, 1)) for values in (started, asked))
    if isinstance(started, Mapping) and isinstance(asked, Mapping):
        for key in dict.fromkeys([*started, *asked]):
            place = f"{at}.{key}" if at else str(key)
            yield from differences(started.get(key, _ABSENT), asked.get(key, _ABSENT), place)
    elif started != asked and not (_is_missing(started) and _is_missing(asked)):
        yield f"{at}: {_shown(started)} then, {_shown(asked)} now"


def _is_missing(value: Any) -> bool:
    return value is None or value is _ABSENT


def _shown(value: Any) -> str:
    text = value if value is _ABSENT else json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
