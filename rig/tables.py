"""Text tables that people make: a CSV file whose first row names columns and their units."""

import csv
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

from sautereau.rig.errors import RigError

_COLUMN = re.compile(r"\s*(\w+)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?\s*")
_SHOWN = 5

Cell = TypeVar("Cell")


def read_table(
    path: Path,
    what: str,
    units: Mapping[str, str],
    example: str,
    read: Callable[[str, str], Cell],
) -> dict[str, list[Cell]]:
    """Read a CSV file's columns; those that are not asked for are left out.

    Args:
        path: The file, UTF-8. The first row names its columns: ``time [s], rise [mm]``.
        what: The file's name in errors.
        units: Wanted columns, each with the unit that it has where the first row gives none.
        example: A first row, for errors.
        read: Makes a cell's value from its column's name and its text with unit; raises
            ValueError with what is wrong.

    Raises:
        RigError: The file cannot be read, a column is missing or named twice, or cells are
            refused; tells the first of them with their lines.
    """
    try:
        rows = list(csv.reader(path.read_text(encoding="utf-8-sig").splitlines()))
    except (OSError, ValueError, csv.Error) as error:
        raise RigError(
            f"{what} {path}: cannot be read: {error}; give the path of a UTF-8 text file"
        ) from error
    columns, faults = _columns(rows[0] if rows else [], units)
    if faults:
        raise RigError(f'{what} {path}: {"; ".join(faults)}; begin the file with "{example}"')
    table: dict[str, list[Cell]] = {name: [] for name in units}
    for number, row in enumerate(rows[1:], 2):
        if not any(cell.strip() for cell in row):
            continue
        for name, (index, unit) in columns.items():
            text = row[index].strip() if index < len(row) else ""
            try:
                table[name].append(read(name, f"{text} {unit}"))
            except ValueError as error:
                faults.append(f"line {number}: {name}: {error}")
    if faults:
        more = f"\n  and {len(faults) - _SHOWN} more" if len(faults) > _SHOWN else ""
        raise RigError(f"{what} {path}: " + "\n  ".join(faults[:_SHOWN]) + more)
    return table


def _columns(first: list[str], units: Mapping[str, str]):
    """Return place and unit of each wanted column, and what is wrong with the first row."""
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
        faults.append(f"the first row names no column {' and no '.join(missing)}")
    return columns, faults
