"""The plan of a session: its presses, where the operator must act, and the changes of a plan.

A plan table is a CSV file: each row is a press with some values of the rig changed.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import BaseModel, JsonValue

from sautereau.daq.file.provenance import check_recordable
from sautereau.rig import disk
from sautereau.rig.csv_files import read_rows
from sautereau.rig.document import comparable, current_key, flat, rig_document, typed_value
from sautereau.rig.errors import RigError
from sautereau.rig.faults import bare_key, fault_list, model_keys, near_miss
from sautereau.rig.load import with_values
from sautereau.rig.schema import Rig
from sautereau.robot.errors import RobotError

EXAMPLE = "press.jack_speed,plectrum.overlap,repeats,notes"
MOST_PRESSES = 100_000
"""Largest number of presses of one row, and of a session: a day of them at full speed."""
MOST_ROWS = 1000  # Limit of a table's lines


@dataclass(frozen=True)
class Row:
    """One or more equal presses."""

    rig: Rig
    """The bench with the row's values."""
    repeats: int = 1
    """Presses, without those for warm-up."""
    values: Mapping[str, str | int | float] = field(default_factory=dict)
    """Values that differ from the rig file, as `with_values` takes them, by dotted key."""
    notes: str = ""
    """The operator's."""
    line: int | None = None
    """Line of the table; None without a table."""
    levels: Mapping[str, str] = field(default_factory=dict)
    """Levels of the factors of a design; empty without one."""
    block: int | None = None
    """Block of the design, from 1."""

    @property
    def set_up(self) -> dict[str, str | int | float]:
        """Those of `values` that the operator must set on the instrument."""
        return {key: value for key, value in self.values.items() if not key.startswith("press.")}

    def document(self) -> dict[str, Any]:
        """Return the row as a JSON document."""
        row = {"values": dict(self.values), "repeats": self.repeats, "notes": self.notes}
        return row | ({"levels": dict(self.levels), "block": self.block} if self.levels else {})

    def on(self, rig: Rig) -> Rig:
        """Return another bench, such as a stand-in's, with the `press` values of this row."""
        return rig.model_copy(update={"press": self.rig.press})


def read_plan_table(path: Path, rig: Rig, repeats: int, notes: str = "") -> tuple[Row, ...]:
    """Read a CSV file whose columns are dotted keys of the rig, `repeats` and `notes`.

    An empty cell leaves a value as the rig has it.

    Args:
        path: The file, as `read_rows` reads it; the first row names the columns, and cells contain
            their units.
        repeats: Presses of a row with an empty `repeats`.
        notes: The operator's, for all rows; those of a row are appended.

    Raises:
        RobotError: Lists every fault of the table, with its line.
    """
    origin = f"plan table {path}"
    shorten = "divide it into sessions, or give equal presses as repeats of one row"
    lines, decimal = read_rows(path, origin, RobotError, MOST_ROWS, shorten)
    columns = [current_key(cell.strip()) for cell in lines[0]] if lines else []
    table = _Table(rig, columns, decimal, repeats, notes, list(_column_faults(columns)))
    read = (
        table.read(line, [cell.strip() for cell in cells])
        for line, cells in enumerate(lines[1:], 2)
    )
    rows = [row for row in read if row is not None]
    if not rows and not table.faults:
        table.faults.append("it has no row; add a row for each set of equal presses")
    if table.faults:
        raise RobotError(fault_list(origin, table.faults))
    return tuple(rows)


@dataclass
class _Table:
    """Reads the rows of a table one by one, and collects their faults."""

    rig: Rig
    columns: list[str]
    decimal: str
    """Separator of decimals."""
    repeats: int
    notes: str
    faults: list[str]
    _benches: dict[tuple[tuple[str, Any], ...], Rig | list[str]] = field(default_factory=dict)

    def read(self, line: int, cells: list[str]) -> Row | None:
        """Return a row; None if it is empty or has a fault."""
        if not any(cells):
            return None
        if len(cells) > len(self.columns):
            self.faults.append(
                f"line {line}: {len(cells)} cells under {len(self.columns)} columns; quote a cell"
                " that contains the separator"
            )
            return None
        given = {name: text for name, text in zip(self.columns, cells, strict=False) if text}
        faults = []
        count = given.pop("repeats", str(self.repeats))
        if not (count.isdecimal() and 1 <= int(count) <= MOST_PRESSES):
            limit = f"give an integer from 1 to {MOST_PRESSES}"
            faults.append(f"repeats: {count!r} is refused: {limit}")
        notes = "; ".join(filter(None, (self.notes, given.pop("notes", ""))))
        values = {
            key: typed_value(key, text.replace(self.decimal, ".")) for key, text in given.items()
        }
        bench = self._bench(values)
        faults += [] if isinstance(bench, Rig) else bench
        self.faults += [f"line {line}: {fault}" for fault in faults]
        if faults or not isinstance(bench, Rig):
            return None
        return Row(bench, int(count), values, notes, line)

    def _bench(self, values: dict[str, Any]) -> Rig | list[str]:
        """Return the rig with a row's values, or its faults; equal rows share it."""
        keys = set(model_keys(Rig))
        known = {key: value for key, value in values.items() if bare_key(key) in keys}
        key = tuple(known.items())
        if key not in self._benches:
            try:
                self._benches[key] = with_values(self.rig, known)
            except RigError as error:
                head, *more = str(error).split("\n")
                faults = [line.strip() for line in more]
                self._benches[key] = faults or [head.removeprefix(f"rig {self.rig.name}: ")]
        return self._benches[key]


def _column_faults(columns: list[str]) -> Iterator[str]:
    """Yield the faults of the first row."""
    if not any(columns):
        yield f'line 1: no columns; start the file like "{EXAMPLE}"'
        return
    known = set(model_keys(Rig))
    for place, name in enumerate(columns, 1):
        if not name:
            yield f"line 1: column {place} has no name; name it, or remove it"
        elif columns.index(name) < place - 1:
            yield f"line 1: column {name} occurs twice; remove one"
        elif bare_key(name) not in known | {"repeats", "notes"}:
            yield f"line 1: {name}: no such quantity in a rig{near_miss(name, sorted(known))}"


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
    with disk.explained(RobotError, f"{path}: cannot be read", "check its name"):
        return disk.digest(path)


def to_set(rig: Rig, set_before: Mapping[str, Any], row: Row) -> dict[str, Any]:
    """Return what the operator must set before a row's presses, by the rig's dotted key.

    Args:
        set_before: Current settings that differ from the rig.
        row: Row of the next presses; settings that it does not change return to the rig's.
    """
    own = flat(rig_document(rig))
    needed = {key: row.set_up.get(key, own.get(key)) for key in [*set_before, *row.set_up]}
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
