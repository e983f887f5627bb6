"""CSV files that people write: a first row with columns and units, rows of quantities.

A gesture is the jack's rise over time; touched points are those of the key that a jogged
fingertip touched, with the joints' readings. Outlines are read in `sautereau.rig.outline`.
"""

import csv
import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple, TypeVar

from sautereau.rig.disk import read_text, why_unreadable
from sautereau.rig.errors import RigError, SautereauError
from sautereau.rig.schema import Arm
from sautereau.rig.units import parse_quantity

_COLUMN = re.compile(r"\s*(\w+)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?\s*")
MOST_ROWS = 20_000  # Limit of a file's rows
_LISTED = 5  # faults in one message
_GESTURE = {"time": "s", "rise": "m"}
_TOUCHED_POINTS = {"point": "m", "joint1": "rad", "joint2": "rad"}

Cell = TypeVar("Cell")


class TouchedPoints(NamedTuple):
    """The m points of the key that the fingertip touched."""

    points: tuple[float, ...]
    """Positions along the key from the balance pin, m, negative in front of it."""
    joints: tuple[tuple[float, float], ...]
    """Readings of joints 1 and 2, rad."""


def read_gesture(path: Path) -> dict[str, list[str]]:
    """Read a CSV file with the columns time and rise, as a rig file would hold them.

    The first row gives the columns with their units: ``time [s], rise [mm]``; the default units
    are s and m.

    Raises:
        RigError: The file cannot be read, a column is missing, or a cell is not a quantity.
    """

    def check(name: str, text: str) -> str:
        parse_quantity(text, _GESTURE[name])
        return text

    return read_columns(path, "gesture file", _GESTURE, "time [s], rise [mm]", check)


def read_touched_points(path: Path, arm: Arm) -> TouchedPoints:
    """Read a CSV file with the columns point, joint1 and joint2.

    The first row gives the columns with their units: ``point [mm], joint1 [counts],
    joint2 [counts]``; joints may also be angles, and the default units are m and rad.

    Raises:
        RigError: The file cannot be read, a column is missing, or a cell is not a quantity.
    """

    def read(name: str, text: str) -> float:
        number, _, unit = text.rpartition(" ")
        if name == "point" or unit not in ("counts", "count"):
            return parse_quantity(text, _TOUCHED_POINTS[name])
        counts = parse_quantity(number, "")
        return counts * 2 * math.pi / arm.counts_per_revolution

    example = "point [mm], joint1 [counts], joint2 [counts]"
    cells = read_columns(path, "touches file", _TOUCHED_POINTS, example, read)
    joints = zip(cells["joint1"], cells["joint2"], strict=True)
    return TouchedPoints(tuple(cells["point"]), tuple(joints))


def read_rows(
    path: Path,
    origin: str,
    error_type: type[SautereauError],
    most: int = MOST_ROWS,
    shorten: str = "give fewer rows",
) -> tuple[list[list[str]], str]:
    """Return the rows of a CSV file, and the sign in place of a decimal point.

    Where the first row has semicolons or tabs, they separate the columns, and numbers may have
    decimal commas.

    Args:
        origin: The file, as messages name it.
        most: Limit of the rows.
        shorten: What to do with a longer file.

    Raises:
        SautereauError: It cannot be read, or has too many rows.
    """
    try:
        lines = read_text(path).splitlines()
        delimiter = next((sign for sign in ";\t" if lines and sign in lines[0]), ",")
        rows = list(csv.reader(lines, delimiter=delimiter, strict=True, skipinitialspace=True))
    except (OSError, ValueError, csv.Error) as error:
        raise error_type(
            f"{origin}: cannot be read: {why_unreadable(error)}; give the path of a CSV file in"
            " UTF-8"
        ) from error
    if len(rows) > most:
        raise error_type(f"{origin}: {len(rows)} rows, more than the limit {most}; {shorten}")
    return rows, "." if delimiter == "," else ","


def read_columns(
    path: Path, what: str, units: Mapping[str, str], example: str, read: Callable[[str, str], Cell]
) -> dict[str, list[Cell]]:
    """Read columns of a CSV file; other columns are ignored.

    Args:
        path: The file; see `read_rows`. The first row names its columns: ``time [s], rise [mm]``.
        units: Requested columns, each with its default unit.
        example: A first row, for messages.
        read: Makes a cell's value from its column's name and its text with unit; raises
            ValueError with the fault.

    Raises:
        RigError: The file cannot be read, a column is missing or named twice, or cells are
            refused; lists the first of them with their lines.
    """
    rows, decimal = read_rows(path, f"{what} {path}", RigError)
    columns, faults = _columns(rows[0] if rows else [], units)
    if faults:
        raise RigError(f'{what} {path}: {"; ".join(faults)}; start the file with "{example}"')
    cells: dict[str, list[Cell]] = {name: [] for name in units}
    for number, row in enumerate(rows[1:], 2):
        if not any(cell.strip() for cell in row):
            continue
        for name, (index, unit) in columns.items():
            text = row[index].strip().replace(decimal, ".") if index < len(row) else ""
            try:
                cells[name].append(read(name, f"{text} {unit}"))
            except ValueError as error:
                faults.append(f"line {number}: {name}: {error}")
    if faults:
        more = f"\n  and {len(faults) - _LISTED} more" if len(faults) > _LISTED else ""
        raise RigError(f"{what} {path}: " + "\n  ".join(faults[:_LISTED]) + more)
    return cells


def _columns(first: list[str], units: Mapping[str, str]):
    """Return index and unit of each requested column, and the faults of the first row."""
    columns: dict[str, tuple[int, str]] = {}
    faults = []
    for index, cell in enumerate(first):
        match = _COLUMN.fullmatch(cell)
        if match is None or match[1] not in units:
            continue
        if match[1] in columns:
            faults.append(f"the first row names {match[1]} twice")
        columns[match[1]] = (index, match[2] or units[match[1]])
    missing = [name for name in units if name not in columns]
    if missing:
        faults.append(f"the first row has no column {' and no '.join(missing)}")
    return columns, faults
