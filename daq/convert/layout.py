"""Layout of a text table: its first row, and the names and units of its columns.

Loggers and oscilloscopes write lines before the table, as `key,value`, `key = value` or comments.
The table is the longest run of lines with numbers in the same columns.
"""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from sautereau.daq.errors import RecordingError
from sautereau.rig.units import parse_quantity

HEAD = 262_144
"""Bytes at the start of a file in which its rows must begin."""
MOST_LINES = 500
"""Limit of the lines in these bytes that are examined."""
DIALECTS = ((";", ","), (";", "."), ("\t", ","), ("\t", "."), (",", "."), (" ", "."), (" ", ","))
"""Delimiters and decimal signs. If several fit equally well, the first of them is used."""
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE)
DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d.*")
IN_NAME = re.compile(r".*?(?:[(\[]\s*([^()\[\]]+?)\s*[)\]]|\s/\s*(\S+))\s*|\S+?/(\S+)")
"""A name with its unit: `force (N)`, `force [N]`, `force / N`, `F/mN`."""
UNIT = re.compile(r"[^\W\d_]{1,20}(\^?[23]|[²³])?(/[^\W\d_]{1,20}(\^?[23]|[²³])?)?")
"""Spelling of a unit in a file; a longer text is not a unit."""
MEASURED_IN = ("V", "s", "m/s", "N", "m", "Hz")
"""Dimensions of the units that are recognised."""
COMMA = str.maketrans({",": ".", ".": "'"})
"""Replaces a comma by a decimal point, and a point by a character that no number contains."""
ROWS = ("record length", "data count", "data quantity", "segmentsize", "points")
"""Keys, in lower case, of a preamble's number of rows."""

Cells = list[str]


@dataclass(frozen=True)
class Layout:
    """First row of a text file, and the information in the lines before it."""

    names: tuple[str, ...]
    skip: int
    """Lines before the first row."""
    delimiter: str
    decimal: str
    encoding: str
    units: dict[str, str]
    dates: dict[str, str]
    """First date of each column of ISO 8601 dates."""
    interval: float | None
    """Sampling interval, s; None if the first lines do not give it."""
    start: float | None
    """Time of the first row, s; None if the first lines do not give it."""
    rows: int | None
    """Number of rows; None if the first lines do not give it."""


def find_layout(path: Path) -> Layout:
    """Find the layout of a text file.

    Raises:
        RecordingError: It is not text, or holds no row with a number in its first lines.
    """
    lines, encoding = _head(path)
    texts = [(number, line) for number, line in enumerate(lines) if line.strip()]
    fitting: list[tuple[int, int, int, list[Cells], tuple[str, str]]] = []
    for dialect in DIALECTS:
        table = [_cells(line, *dialect) for _, line in texts]
        start, length = _longest_run(table)
        if length and (dialect[0] in texts[start][1] or dialect == (",", ".")):
            fitting.append((length, sum(map(_is_number, table[start])), start, table, dialect))
    if not fitting:
        raise RecordingError(
            f"it has no rows of numbers in its first {max(1, len(lines))} lines; give a table with"
            " numbers"
        )
    _, _, start, table, dialect = max(fitting, key=lambda one: one[:2])  # the first of equals
    return _described(table, start, texts[start][0], dialect, encoding)


def is_unit(text: str) -> bool:
    """Return whether a text is a unit that sensors, clocks or cards use."""
    if not UNIT.fullmatch(text):
        return False
    for spelling in {text, text.lower()}:
        for unit in MEASURED_IN:
            try:
                parse_quantity(f"1 {spelling}", unit)
            except ValueError:
                continue
            return True
    return False


def _head(path: Path) -> tuple[list[str], str]:
    """Return the first lines, complete and without line ends, and the encoding of the file."""
    with path.open("rb") as file:
        data = file.read(HEAD)
        complete = not file.read(1)
    if b"\0" in data:
        raise RecordingError("it is not text in UTF-8; save it as UTF-8")
    encoding = "utf-8-sig"
    try:
        text = data.decode(encoding, errors="strict" if complete else "ignore")
    except UnicodeDecodeError as error:
        # Western instruments write µ and ° in Windows' code page; the numbers are ASCII.
        encoding = "cp1252"
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            raise RecordingError(f"it is not UTF-8 text: {error}; save it as UTF-8") from error
    lines = text.splitlines()
    return (lines if complete else lines[:-1])[:MOST_LINES], encoding


def _cells(line: str, delimiter: str, decimal: str) -> Cells:
    """Return the cells of a line, numbers with a decimal point."""
    if delimiter == " ":
        cells = line.split()
    else:
        cells = [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]
    if decimal == ".":
        return cells
    swapped = [cell.translate(COMMA) for cell in cells]
    return [
        new if _is_number(new) or _is_number(old) else old
        for new, old in zip(swapped, cells, strict=True)
    ]


def _is_number(cell: str) -> bool:
    return NUMBER.fullmatch(cell) is not None


def _longest_run(table: list[Cells]) -> tuple[int, int]:
    """Return the first line of the longest run of rows, and its length; 0 if there is none.

    Rows of numbers alone are preferred to rows that also hold text, as a preamble does.
    """
    runs = {}
    for pure in (True, False):
        start, pattern, longest = 0, None, (0, 0)
        for i, cells in enumerate(table):
            kinds = [_is_number(cell) if cell else None for cell in cells]
            if pattern is not None and not _alike(kinds, pattern):
                pattern = None
            if pattern is None and any(kinds) and not (pure and False in kinds):
                start, pattern = i, kinds
            if pattern is not None and i + 1 - start > longest[1]:
                longest = (start, i + 1 - start)
        runs[pure] = longest
    (start, length), (_, mixed) = runs[True], runs[False]
    if not length or (start + length < len(table) and length < mixed):
        start, length = runs[False]
    if not length:
        return 0, 0
    numbers = [k for k, cell in enumerate(table[start]) if _is_number(cell)]
    while start and len(table[start - 1]) == len(table[start]):
        if not all(_is_number(table[start - 1][k]) for k in numbers):
            break
        start, length = start - 1, length + 1
    return start, length


def _alike(kinds: Sequence[bool | None], pattern: Sequence[bool | None]) -> bool:
    """Return whether two rows have numbers in the same columns; an empty cell may be either."""
    if len(kinds) != len(pattern):
        return False
    return all(a is None or b is None or a == b for a, b in zip(kinds, pattern, strict=True))


def _described(
    table: list[Cells], start: int, skip: int, dialect: tuple[str, str], encoding: str
) -> Layout:
    """Return the layout of a table whose first row is ``table[start]``, after ``skip`` lines."""
    above, row = table[:start], table[start]
    width = len(row)
    heads = [_names_in(cells, width) for cells in above[-2:]]
    names, units = (heads[-1] if heads else None), {}
    interval = first = None
    if len(above) > 1 and "increment" in (lower := [cell.lower() for cell in above[-2]]):
        # Rigol: X,CH1,Start,Increment, and below Sequence,Volt,-3e-3,1e-6.
        names, values = above[-2][:width], dict(zip(lower, above[-1], strict=False))
        interval, first = _number(values["increment"]), _number(values.get("start", ""))
        units = dict(zip(names[1:], above[-1][1:], strict=False))
    elif names and len(heads) > 1 and heads[0] and _are_units(names):
        names, units = heads[0], dict(zip(heads[0], map(_inner, names), strict=True))
    preamble = _preamble(table)
    columns = _distinct([*(names or []), *[""] * width][:width])
    units = {columns[(names or []).index(n)]: u for n, u in units.items() if n in columns}
    for name in columns:
        match = IN_NAME.fullmatch(name)
        if match and name not in units and not is_unit(name):
            units[name] = _inner(match[1] or match[2] or match[3])
    vertical = preamble.get("vertical units", [])
    units = dict(zip(columns[1:], vertical, strict=False)) | units
    units = dict(zip(columns[:1], preamble.get("horizontal units", []), strict=False)) | units
    units = dict(zip(columns, preamble.get("unit", []), strict=False)) | units
    if interval is None and (given := preamble.get("sample interval")):
        interval = _number(given[0])
    counts = [_number(v[0]) for k, v in preamble.items() if k in ROWS and v]
    return Layout(
        names=tuple(columns),
        skip=skip,
        delimiter=dialect[0],
        decimal=dialect[1],
        encoding=encoding,
        units={name: unit for name, unit in units.items() if is_unit(unit)},
        dates={n: c for n, c in zip(columns, row, strict=False) if DATE.fullmatch(c)},
        interval=interval if interval and interval > 0 else None,
        start=first,
        rows=next((round(count) for count in counts if count), None),
    )


def _are_units(cells: Cells) -> bool:
    """Return whether most cells are recognised as units; `degC` is not."""
    known = [is_unit(_inner(cell)) for cell in cells if cell]
    return not known or 2 * sum(known) > len(known)


def _names_in(cells: Cells, width: int) -> Cells | None:
    """Return the names in the line above the rows; None if it is not a line of names."""
    cells = cells[cells[0] == "#" :]
    last = max((i for i, cell in enumerate(cells) if cell), default=-1)
    bare = cells[: last + 1]
    if not cells or (len(bare) != width and len(cells) != width):
        return None
    if cells[0].startswith("#") and width == 1:
        return None
    texts = [cell.lstrip("# ") for cell in (cells if len(cells) == width else bare)]
    if _is_number(texts[0]) or any("=" in cell for cell in texts):
        return None
    # Keysight calls its columns x-axis, 1, 2.
    numbers = [_is_number(cell) for cell in texts]
    return texts if not any(numbers) or texts[0] == "x-axis" else None


def _inner(text: str) -> str:
    return text.strip("()[] ")


def _distinct(names: Cells) -> Cells:
    """Return the names, those that are empty or repeated with the number of their column."""
    return [
        f"{name} (column {i})" if name and names.count(name) > 1 else name or str(i)
        for i, name in enumerate(names, 1)
    ]


def _preamble(table: list[Cells]) -> dict[str, Cells]:
    """Return the values of each key, in lower case, of `key,value` and `key = value`."""
    found: dict[str, Cells] = {}
    for cells in table:
        head, equals, value = (cells[0] if cells else "").partition("=")
        texts = [head, value, *cells[1:]] if equals else cells
        for place in (0, 2):  # LeCroy writes two pairs in a line
            if len(texts) > place + 1 and texts[place] and not _is_number(texts[place]):
                key = texts[place].strip("#: ").lower()
                found.setdefault(key, [text.strip() for text in texts[place + 1 :]])
    return found


def _number(text: str) -> float | None:
    return float(text) if _is_number(text) else None
