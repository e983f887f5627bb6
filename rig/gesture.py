"""A recorded gesture: a text file of the jack's rise over time."""

import csv
import re
from pathlib import Path

from rig.errors import RigError
from rig.units import parse_quantity

_COLUMN = re.compile(r"\s*(time|rise)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?\s*")
_SI = {"time": "s", "rise": "m"}


def read_gesture(path: Path) -> dict[str, list[str]]:
    """Read a CSV file with the columns time and rise, as a rig file would hold them.

    The first row names the columns, with their units: ``time [s], rise [mm]``; without
    one, s and m are meant.

    Raises:
        RigError: The file cannot be read, a column is missing, or a cell is no number.
    """
    try:
        rows = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    except (OSError, ValueError, csv.Error) as error:
        raise RigError(f"gesture file {path}: cannot be read: {error}") from error
    columns: dict[str, tuple[int, str]] = {}
    for index, cell in enumerate(rows[0] if rows else []):
        if match := _COLUMN.fullmatch(cell):
            columns[match[1]] = (index, match[2] or _SI[match[1]])
    missing = sorted(_SI.keys() - columns.keys())
    if missing:
        raise RigError(
            f"gesture file {path}: the first row names no column {' and no '.join(missing)};"
            ' begin the file with "time [s], rise [mm]"'
        )
    gesture: dict[str, list[str]] = {"time": [], "rise": []}
    faults = []
    for number, row in enumerate(rows[1:], 2):
        if not row:
            continue
        for name, (index, unit) in columns.items():
            text = f"{row[index].strip() if index < len(row) else ''} {unit}"
            try:
                parse_quantity(text, _SI[name])
            except ValueError as error:
                faults.append(f"line {number}: {name}: {error}")
            gesture[name].append(text)
    if faults:
        more = f"\n  and {len(faults) - 5} more" if len(faults) > 5 else ""
        raise RigError(f"gesture file {path}: " + "\n  ".join(faults[:5]) + more)
    return gesture
