"""Layout of a text table: its first row, and the names and units of its columns.

Loggers and oscilloscopes write lines before the table, as `key,value`, `key = value` or comments.
The table is the longest run of lines with numbers in the same columns. Where a file can be read in
two ways, it is refused, and an option decides.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from sautereau.daq.convert.preamble import INTERVALS, RATES, Preamble, is_unit
from sautereau.daq.convert.text import (
    CLOCK,
    cells_of,
    encoding_of,
    iso_date,
    kind_of,
    lines_of,
    number_in,
)
from sautereau.daq.errors import RecordingError
from sautereau.rig.units import shown

MOST_SKIPPED = 100_000  # Limit of --skip: these lines are kept in memory
# If several read the same numbers, the first of them is used.
DELIMITERS = (";", "\t", "|", ",", " ")
IN_NAME = re.compile(r".*?(?:[(\[]\s*([^()\[\]]+?)\s*[)\]]|\s/\s*(\S+))\s*|\S+?/(\S+)")
"""A name with its unit: `force (N)`, `force [N]`, `force / N`, `F/mN`."""
Cells = list[str]


@dataclass(frozen=True)
class Layout:
    """First row of a text file, and the information in the lines before it."""

    names: tuple[str, ...]
    kinds: str
    """Kind of each column, see `kind_of`; a space if its first cells are empty."""
    skip: int
    """Lines before the first row."""
    delimiter: str
    decimal: str
    """Empty if the first rows have integers only."""
    sure: bool
    """Whether the decimal sign cannot be a separator of thousands."""
    encoding: str
    named: int | None
    """Line of the names, from 1."""
    units: dict[str, str]
    first: tuple[str, ...]
    """First time in each column of times of the clock, otherwise empty."""
    rate: float | None
    """Sampling rate, Hz; None if the first lines do not give it."""
    start: float | None
    """Time of the first row, s; None if the first lines do not give it."""
    rows: int | None
    """Number of rows; None if the first lines do not give it."""
    unread: tuple[str, ...]
    """Known keys of the first lines whose values are not understood."""

    @property
    def dates(self) -> dict[str, str]:
        """First date of each column of dates, ISO 8601."""
        dates = {name: iso_date(cell) for name, cell in zip(self.names, self.first, strict=True)}
        return {name: date for name, date in dates.items() if date}

    def __str__(self) -> str:
        """Return the layout in words."""
        parts = [f"{self.skip} line{'s' * (self.skip != 1)} before the rows"]
        parts.append("no names" if self.named is None else f"names in line {self.named}")
        if len(self.names) > 1:
            parts.append(f"delimiter {self.delimiter!r}")
        if self.decimal:
            parts.append("decimal " + ("comma" if self.decimal == "," else "point"))
        if self.encoding != "utf-8-sig":
            parts.append(f"encoding {self.encoding}")
        if self.rate is not None:
            parts.append(f"rate {self.rate:.9g} Hz")
        if self.rows is not None:
            parts.append(f"{self.rows} rows stated")
        return ", ".join([*parts, *(f"not understood: {text!r}" for text in self.unread)])


@dataclass(frozen=True)
class _Fit:
    """A table that is found with one delimiter and one decimal sign."""

    delimiter: str
    decimal: str
    table: list[Cells]
    start: int
    """Index of its first row."""
    length: int
    """Number of its rows in the lines that are examined."""
    kinds: str
    """Kind of each column."""
    grouped: int
    """Number of cells with separators of thousands."""

    @property
    def pure(self) -> bool:
        """Whether its rows hold numbers and times alone."""
        return "x" not in self.kinds

    @property
    def order(self) -> tuple[int, ...]:
        """Return what makes one fit better than another."""
        return self.length * self.kinds.count("n"), self.pure, -self.grouped

    @property
    def numbers(self) -> list[Cells]:
        """The cells that hold numbers."""
        columns = [k for k, kind in enumerate(self.kinds) if kind == "n"]
        return [[row[k] for k in columns] for row in self.table[self.start :][: self.length]]


def find_layout(
    path: Path, decimal: str = "", skip: int | None = None, columns: Sequence[str] = ()
) -> Layout:
    """Find the layout of a text file.

    Args:
        path: The file.
        decimal: Decimal sign; empty if it must be found.
        skip: Lines before the first row; None if they must be found.
        columns: Columns that are imported; they decide between two ways to read the file.

    Raises:
        RecordingError: It is not text, holds no row with a number in its first lines, or can be
            read in two ways.
    """
    if skip is not None and not 0 <= skip <= MOST_SKIPPED:
        raise RecordingError(f"--skip {skip} is not from 0 to MOST_SKIPPED = {MOST_SKIPPED}")
    encoding = encoding_of(path)
    lines = list(islice(lines_of(path, encoding), (skip or 0) + 500))
    texts = [(number, line) for number, line in enumerate(lines, 1) if line.strip()]
    first = None if skip is None else sum(number <= skip for number, _ in texts)
    fits = []
    for delimiter in DELIMITERS:
        signs = [s for s in ",." if s != delimiter and s in (decimal or s)]
        found = [_fit([line for _, line in texts], delimiter, sign, first) for sign in signs]
        found = [fit for fit in found if fit is not None]
        if found:
            best = max(found, key=lambda fit: fit.order)
            alike = len(found) == 2 and not decimal and found[0].order == found[1].order
            fits.append(replace(best, decimal="") if alike else best)
    if not fits:
        raise RecordingError(
            f"it has no rows of numbers in its first {max(1, len(lines))} lines; give a table with"
            " numbers, or give --skip if they begin below"
            if skip is None
            else f"line {skip + 1}, the first after --skip {skip}, is no row of numbers"
        )
    best = max(fits, key=lambda fit: fit.order)  # the first of equals
    rivals = [fit for fit in fits if fit.start == best.start and fit.pure and best.pure]
    rivals += [fit for fit in fits if not best.pure and fit.order[:2] == best.order[:2]]
    found = [(fit, _described(fit, texts, encoding, bool(decimal))) for fit in rivals or [best]]
    # What is taken for names may be a title, and the columns are then called 1, 2 and so on.
    fitting = [
        (fit, layout)
        for fit, layout in found
        if {*columns} <= {*layout.names, *map(str, range(1, len(layout.names) + 1))}
    ]
    best, layout = max(fitting or found, key=lambda one: one[0].order)
    if differing := [fit for fit, _ in fitting if fit.numbers != best.numbers]:
        number, line = texts[best.start]
        readings = " or ".join(
            f"{' and '.join(fit.numbers[0])} with --decimal {fit.decimal or '.'}"
            for fit in (best, *differing)
        )
        raise RecordingError(
            f"line {number}, {shown(line.strip())}, is {readings}; give one of them"
        )
    if skip is None:
        _refuse_rows_above(best, layout.named is not None, texts)
        if layout.named is None:
            _refuse_fewer_names(best, texts)
    return layout


def _fit(lines: list[str], delimiter: str, decimal: str, first: int | None) -> _Fit | None:
    """Return the table that is found with a delimiter and a decimal sign."""
    table = [cells_of(line, delimiter) for line in lines]
    raw = ["".join(kind_of(cell, decimal) for cell in cells) for cells in table]
    kinds = [kind.replace("g", "n") for kind in raw]
    start, length = _longest_run(kinds) if first is None else _run_from(kinds, first)
    if not length or (delimiter not in lines[start] and delimiter not in ",;|"):
        return None
    run = slice(start, start + length)
    columns = (set(column) - {" "} for column in zip(*kinds[run], strict=True))
    merged = "".join(kind.pop() if len(kind) == 1 else "x" if kind else " " for kind in columns)
    return _Fit(delimiter, decimal, table, start, length, merged, "".join(raw[run]).count("g"))


def _refuse_rows_above(fit: _Fit, named: bool, texts: list[tuple[int, str]]) -> None:
    """Refuse a table with lines above it that look like its rows, or begin as they do.

    Without names, the line just above may also be a row whose first number is damaged.
    """
    rows = ["".join(kind_of(cell, fit.decimal or ".") for cell in cells) for cells in fit.table]
    for k, ((number, _), kinds) in enumerate(zip(texts[: fit.start], rows, strict=False)):
        damaged = k == fit.start - 1 and not named and not {"=", ":"} & set(fit.table[k][0])
        if (
            _is_row(kinds, fit.kinds)
            or kinds[0].replace("g", "n") == fit.kinds[0] == "n"
            or (kinds[0] == fit.kinds[0] == "t" and len(kinds) == len(fit.kinds))
            or (damaged and _numbers_of(kinds, fit.kinds))
        ):
            begin = texts[fit.start][0]
            between = range(k, fit.start + 1)
            other = (j for j in between if not _is_row(rows[j], fit.kinds))
            # Or it has a number where the first has a text, as by another decimal sign.
            bad = next(other, next((j for j in between if rows[j] != rows[k]), fit.start))
            line, text = texts[bad]
            raise RecordingError(
                f"its rows seem to begin in line {number}, but line {line}, {shown(text.strip())},"
                " is none; correct it or cut the file before it, or give"
                f" --skip {begin - 1} if they begin in line {begin}"
            )


def _refuse_fewer_names(fit: _Fit, texts: list[tuple[int, str]]) -> None:
    """Refuse rows with more cells than the names above them: the delimiter may be in the numbers.

    So are a decimal comma beside the delimiter comma, and a space between thousands.
    """
    names = list(filter(None, fit.table[fit.start - 1])) if fit.start else []
    cells = len(fit.kinds.rstrip())
    text = all(kind_of(name, ".") == "x" and not {"=", ":"} & set(name) for name in names)
    # One name may be a title, unless each of its numbers would be cut into two.
    if text and (1 < len(names) < cells or (len(names), cells, fit.delimiter) == (1, 2, ",")):
        (above, line), (number, _) = texts[fit.start - 1], texts[fit.start]
        raise RecordingError(
            f"line {above}, {shown(line.strip())}, has {len(names)} cells with the delimiter"
            f" {fit.delimiter!r}, and the rows from line {number} on have {cells}; write numbers"
            f" without it, or give --skip {number - 1} if that line holds no names"
        )


def _numbers_of(kinds: str, pattern: str) -> int:
    """Return how many numbers of a row a line has; 0 if it has another number of cells."""
    kinds, pattern = kinds.rstrip(), pattern.rstrip()
    same = len(kinds) == len(pattern)
    return sum(a == b == "n" for a, b in zip(kinds, pattern, strict=True)) if same else 0


def _longest_run(table: list[str]) -> tuple[int, int]:
    """Return the first line of the longest run of rows, and its length; 0 if there is none.

    Rows of numbers and times alone are preferred to rows that also hold text, as a preamble does.
    """
    runs = {}
    for pure in (True, False):
        start, pattern, longest = 0, None, (0, 0)
        for i, kinds in enumerate(table):
            if pattern is not None and not _alike(kinds, pattern):
                pattern = None
            if pattern is None and "n" in kinds and not (pure and "x" in kinds):
                start, pattern = i, kinds
            if pattern is not None and i + 1 - start > longest[1]:
                longest = (start, i + 1 - start)
        runs[pure] = longest
    (start, length), (_, mixed) = runs[True], runs[False]
    if not length or (start + length < len(table) and length < mixed):
        start, length = runs[False]
    while length and start and _is_row(table[start - 1], table[start].replace("x", " ")):
        start, length = start - 1, length + 1
    return start, length


def _run_from(table: list[str], first: int) -> tuple[int, int]:
    """Return a first row, and how many follow it; 0 if it has no number."""
    end = first
    while end < len(table) and "n" in table[first] and _alike(table[end], table[first]):
        end += 1
    return first, end - first


def _alike(kinds: str, pattern: str) -> bool:
    """Return whether two rows have numbers in the same columns; an empty cell may be either."""
    return len(kinds) == len(pattern) and all(
        a == b or " " in (a, b) for a, b in zip(kinds, pattern, strict=True)
    )


def _is_row(kinds: str, pattern: str) -> bool:
    """Return whether a line has all numbers and times of a row."""
    return len(kinds) == len(pattern) and all(
        a == b or (a == "g" and b == "n") for a, b in zip(kinds, pattern, strict=True) if b in "nt"
    )


def _described(fit: _Fit, texts: list[tuple[int, str]], encoding: str, sure: bool) -> Layout:
    """Return the layout of a table."""
    table, start = fit.table, fit.start
    above, run, width = table[:start], table[start:][: fit.length], len(fit.kinds)
    used = len(fit.kinds.rstrip())
    heads = [_names_in(cells, width, used) for cells in above[-2:]]
    names, units, named = (heads[-1] if heads else None), {}, start
    rate = first = None
    if len(above) > 1 and "increment" in (lower := [cell.lower() for cell in above[-2]]):
        # Rigol: X,CH1,Start,Increment, and below Sequence,Volt,-3e-3,1e-6.
        names, values = above[-2][:width], dict(zip(lower, above[-1], strict=False))
        named -= 1
        rate, first = _inverse(number_in(values["increment"])), number_in(values.get("start", ""))
        units = dict(zip(names[1:], above[-1][1:], strict=False))
    elif names and len(heads) > 1 and heads[0] and _are_units(names):
        named -= 1
        names, units = heads[0], dict(zip(heads[0], map(_inner, names), strict=False))
    columns = _distinct([*(names or []), *[""] * width][:width])
    units = {columns[(names or []).index(n)]: u for n, u in units.items() if n in columns}
    for name in columns:
        match = IN_NAME.fullmatch(name)
        if match and name not in units and not is_unit(name):
            units[name] = _inner(match[1] or match[2] or match[3])
    lines = [line for k, (_, line) in enumerate(texts) if not names or k != named - 1]
    preamble = Preamble(lines, fit.delimiter, fit.decimal or ".")
    units = dict(zip(columns[1:], preamble.texts("vertical units"), strict=False)) | units
    units = dict(zip(columns[:1], preamble.texts("horizontal units"), strict=False)) | units
    units = dict(zip(columns, preamble.texts("unit"), strict=False)) | units
    stated = [preamble.quantity(RATES, "Hz"), _inverse(preamble.quantity(INTERVALS, "s"))]
    rows = preamble.count()
    return Layout(
        names=tuple(columns),
        kinds=fit.kinds,
        skip=texts[start][0] - 1,
        delimiter=fit.delimiter,
        decimal=fit.decimal,
        sure=sure or (fit.delimiter == "," and width > 1),
        encoding=encoding,
        named=texts[named - 1][0] if names else None,
        units={name: unit for name, unit in units.items() if is_unit(unit)},
        first=tuple(next(filter(CLOCK.fullmatch, column), "") for column in zip(*run, strict=True)),
        rate=next((value for value in (rate, *stated) if value), None),
        start=first,
        rows=rows,
        unread=tuple(preamble.unread),
    )


def _are_units(cells: Cells) -> bool:
    """Return whether most cells are recognised as units; `degC` is not."""
    known = [is_unit(_inner(cell)) for cell in cells if cell]
    return not known or 2 * sum(known) > len(known)


def _names_in(cells: Cells, width: int, used: int) -> Cells | None:
    """Return the names in the line above the rows; None if it is not a line of names.

    Args:
        cells: The line.
        width: Number of cells in a row.
        used: The same without the last ones if they are empty.
    """
    cells = cells[cells[0] == "#" :]
    last = max((i for i, cell in enumerate(cells) if cell), default=-1)
    bare = cells[: last + 1]
    if len(bare) == used + 1 and bare[-1].lower() == "comment":
        bare = bare[:-1]  # LabVIEW's last name, whose cells it does not write
    if not cells or (len(bare) not in (width, used) and len(cells) != width):
        return None
    if cells[0].startswith("#") and width == 1:
        return None
    texts = [cell.lstrip("# ") for cell in (cells if len(cells) == width else bare)]
    numbers = [kind_of(cell, ".") == "n" for cell in texts]
    if numbers[0] or any("=" in cell for cell in texts):
        return None
    # Keysight calls its columns x-axis, 1, 2.
    return texts if not any(numbers) or texts[0] == "x-axis" else None


def _inner(text: str) -> str:
    return text.strip("()[] ")


def _distinct(names: Cells) -> Cells:
    """Return the names, those that are empty or repeated with the number of their column."""
    return [
        f"{name} (column {i})" if name and names.count(name) > 1 else name or str(i)
        for i, name in enumerate(names, 1)
    ]


def _inverse(value: float | None) -> float | None:
    return float(f"{1 / value:.9g}") if value and value > 0 else None
