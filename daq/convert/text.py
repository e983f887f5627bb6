"""Lines, cells, numbers and times of a text table: one reader for its layout and its values."""

import codecs
import csv
import io
import re
from collections.abc import Iterator, Sequence
from datetime import date
from pathlib import Path

from sautereau.daq.errors import RecordingError
from sautereau.rig.disk import open_regular

LONGEST_LINE = 100_000
"""Limit of the characters of a line; the csv module's limit of a cell is 131,072."""
_POINT = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+|[dD][+-]\d+)?|[+-]?(?:nan|inf|infinity)"
NUMBER = {
    sign: re.compile(pattern, re.IGNORECASE | re.ASCII)
    for sign, pattern in {
        ".": _POINT,
        ",": _POINT.replace(r"\d+\.?\d*", r"\d+(?:,\d+)?").replace(r"\.", ","),
    }.items()
}
"""A number, by its decimal sign."""
GROUPED = re.compile(
    r"[+-]?[1-9]\d{0,2}(?:([.,'’\u00a0\u202f])\d{3})(?:\1\d{3})*(?:[.,]\d+)?", re.A
)
"""A number with separators between its thousands, or one that looks so: `1,234`."""
FORTRAN = str.maketrans("dD", "ee")  # Its exponents of double precision: 1.5D-03
COMMA = str.maketrans({",": ".", ".": "'"})
"""Replaces a comma by a decimal point, and a point by a character that no number contains."""
RULED, RULE = frozenset("|+-="), re.compile(r"[-+|=:\s]{3,}")
"""A line between the names and the rows of a table that is drawn with characters."""
MINUS = "\u2212"  # The sign itself, which some programs write in place of a hyphen
PLAIN = re.compile(r"[-+.\deE\n]*", re.ASCII)  # Cells that `float` reads as `NUMBER` does
CLOCK = re.compile(
    r"(?:(?:(\d{4})-(\d\d)-(\d\d)|(\d\d?)\.(\d\d?)\.(\d{4}))(?:T|\s+)(?=\d)|(?=\d\d?:\d\d:))"
    r"(\d\d?):(\d\d)(?::(\d\d)(?:[.,](\d+))?)?\s?(Z|[+-]\d\d:?\d\d)?",
    re.ASCII,
)
"""A time of the clock with seconds, or with a date: ISO 8601, or `dd.mm.yyyy hh:mm:ss`."""


def encoding_of(path: Path) -> str:
    """Return the encoding of a text file.

    Raises:
        RecordingError: It is not text.
    """
    with open_regular(path) as file:
        data = file.read(262_144)  # Its rows must begin there
        complete = not file.read(1)
    if (at := data.find(b"\0")) >= 0:
        raise RecordingError(f"byte {at} is 0, as in UTF-16 or a damaged file; save it as UTF-8")
    for encoding in ("utf-8-sig", "cp1252"):  # Western instruments write µ and ° in Windows' page
        try:
            codecs.getincrementaldecoder(encoding)().decode(data, final=complete)
        except UnicodeDecodeError as error:
            fault = error
        else:
            return encoding
    raise RecordingError(f"it is not UTF-8 text: {fault}; save it as UTF-8")


def lines_of(path: Path, encoding: str) -> Iterator[str]:
    r"""Yield the lines of a file without their ends, which are \n, \r or both, and nothing else.

    Raises:
        RecordingError: It has another encoding, or too long a line.
    """
    rest = ""
    try:
        with open_regular(path) as raw, io.TextIOWrapper(raw, encoding) as file:
            while text := file.read(1_048_576):
                *lines, rest = (rest + text.replace(MINUS, "-")).split("\n")
                if len(rest) > LONGEST_LINE or any(len(line) > LONGEST_LINE for line in lines):
                    raise RecordingError(
                        f"a line is longer than LONGEST_LINE = {LONGEST_LINE} characters; give a"
                        " table with a row in each line"
                    )
                for line in lines:
                    yield "" if line[:1] in RULED and RULE.fullmatch(line) else line
    except UnicodeDecodeError as error:
        raise RecordingError(
            f"it begins as {encoding} text, and then has {error.object[error.start]:#x}, which is"
            " none; save it as UTF-8"
        ) from error
    if rest:
        yield rest


def cells_of(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line; several spaces count as one delimiter."""
    if delimiter == " ":
        line = " ".join(line.split())
    elif delimiter == "|":
        line = line.strip().removeprefix("|").removesuffix("|")
    if '"' in line or line.startswith("'"):
        quote = '"' if '"' in line else "'"
        quoted = csv.reader([line], delimiter=delimiter, quotechar=quote, skipinitialspace=True)
        return [cell.strip() for cell in next(quoted, [])]
    return [*map(str.strip, line.split(delimiter))]


def kind_of(cell: str, decimal: str) -> str:
    """Return the kind of a cell: n number, g grouped number, t time, x text, or space if empty."""
    if not cell:
        return " "
    if NUMBER[decimal].fullmatch(cell):
        return "n"
    if GROUPED.fullmatch(cell):
        return "g"
    return "t" if CLOCK.fullmatch(cell) else "x"


def number_in(text: str, decimal: str = ".") -> float | None:
    """Return the number that a text is, None if it is none."""
    return _float(text) if NUMBER[decimal].fullmatch(text) else None


def _float(text: str) -> float:
    """Return the value of a text that is a number, with either decimal sign."""
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return float(text.replace(",", ".").translate(FORTRAN))


class Numbers:
    """Converts the cells of a file to numbers, with one decimal sign for all of them."""

    def __init__(self, decimal: str, sure: bool):
        """Begin a file.

        Args:
            decimal: The decimal sign; empty if no number has shown it yet.
            sure: Whether it cannot be a separator of thousands.
        """
        self.decimal = decimal
        self.doubt = ""
        """A number whose decimal sign may be a separator of thousands, if all are like it."""
        self._sure = sure

    def read(self, cells: Sequence[str]) -> list[float]:
        """Return the numbers, NaN for an empty cell.

        Raises:
            NotANumberError: A cell holds none.
        """
        if not self.decimal:
            signed = (cell for cell in cells if "," in cell or "." in cell)
            self.decimal = next((max(",.", key=cell.rfind) for cell in signed), "")
        if self.decimal and not self._sure:
            self._be_sure(cells)
        text = "\n".join(cells)
        if self.decimal == ",":
            text = text.translate(COMMA)
        if PLAIN.fullmatch(text):
            try:
                return list(map(float, text.split("\n")))
            except ValueError:
                pass  # an empty cell, or one that is no number
        known = NUMBER[self.decimal or "."]
        for at, cell in enumerate(cells):
            if cell and not known.fullmatch(cell):
                raise NotANumberError(at, cell)
        return [_float(cell or "nan") for cell in cells]

    def _be_sure(self, cells: Sequence[str]) -> None:
        for cell in cells:
            if self.decimal in cell:
                self.doubt = self.doubt or cell
                if not GROUPED.fullmatch(cell):
                    self._sure, self.doubt = True, ""
                    return


class NotANumberError(ValueError):
    """A cell that holds no number, or no time."""

    def __init__(self, at: int, cell: str):
        """Name the cell, and its place in the column, from 0."""
        super().__init__(cell)
        self.at = at
        self.cell = cell


def iso_date(cell: str) -> str | None:
    """Return a date as ISO 8601, None for a time without one."""
    match = CLOCK.fullmatch(cell)
    if match is None or not any(day := _day(match)):
        return None
    clock = f"{match[7]:0>2}:{match[8]}:{match[9] or '00'}.{match[10] or '0'}{match[11] or ''}"
    return "{}-{:0>2}-{:0>2}T".format(*day) + clock


def nanoseconds_of(cells: Sequence[str], first: str) -> list[int]:
    """Return times of the clock in ns, after the first; 0 for an empty cell.

    Args:
        cells: The times.
        first: The first of the column; all have a date and a time zone, or none has.

    Raises:
        NotANumberError: A cell holds no such time.
    """
    form, begin, found = None, 0, []
    for at, cell in enumerate((first, *cells), -1):
        match = CLOCK.fullmatch(cell or first)
        try:
            time = _nanoseconds(match) if match else None
        except ValueError:
            time = None
        own = match and [match[group] is None for group in (1, 6, 11)]
        if at < 0:
            form, begin = own, time
        if time is None or begin is None or own != form:
            raise NotANumberError(max(at, 0), cell or first)
        found.append(time - begin)
    return found[1:]


def _day(match: re.Match[str]) -> tuple[str, str, str]:
    """Return year, month and day of a time."""
    return (match[1], match[2], match[3]) if match[1] else (match[6], match[5], match[4])


def _nanoseconds(match: re.Match[str]) -> int:
    day = _day(match)
    days = date(*map(int, day)).toordinal() if any(day) else 0
    hours, minutes, seconds = int(match[7]), int(match[8]), int(match[9] or 0)
    if hours > 23 or minutes > 59 or seconds > 60:  # 60 is a leap second
        raise ValueError
    zone = (match[11] or "Z").replace(":", "")
    if zone != "Z":
        minutes -= int(zone[0] + "1") * (60 * int(zone[1:3]) + int(zone[3:]))
    fraction = int(f"{match[10] or '0':0<9}"[:9])
    return (((days * 24 + hours) * 60 + minutes) * 60 + seconds) * 10**9 + fraction
