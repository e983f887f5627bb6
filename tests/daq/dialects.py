"""Random text tables of known content, as other programs write them, complete and damaged.

A `Dialect` lists the choices; its defaults are the plainest table. `draw` chooses at random from a
seed, `write` makes the bytes with their true values, and `simpler` returns the dialects one step
closer to the plainest, to find the smallest table with a fault.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from random import Random

import numpy as np

BLANKS = (" ", "   ")
UNIX = Decimal(1770087906)  # 2026-02-03 03:05:06 UTC
BAD_CELLS = ("OVL", "NaN", "nan", "inf", "-inf", "", "--", "∞", "1.#INF", "#N/A", "null", "1.2.3",
             "5{s}7")  # fmt: skip
PREAMBLE = (
    "Press {a} of 12, at {x} m/s", "Operator: A. Smith, room {a}.07", "2026-02-03 04:05:06",
    "Serial number{s}{a}{b}", "Vertical Scale{s}{x}", "Trigger Level{s}{x}{s}V", "",
    "Temperature{s}{x} °C", "Force range: {a} N", "[Data]", "----------", "gain {a}; offset {x}",
    "Model{s}TDS2024C", "µ-metal shield{s}{a} mm", "Filter = {a}{b} Hz", "({a}, {b})",
    "Channel{s}1{s}2{s}3", "Title: {a} {b}", "Date/Time{s}03.02.2026 04:05:0{a}",
)  # fmt: skip
ODD_TEXTS = {
    "separator": "Notes: page{odd}{row}",
    "inch": 'Travel {a}"{s}of the key',
    "quote": '"Title{s}{a}',
    "commented row": "# {row}",
    "numbers": "{row}",
    "calibration": "{row}\n{row}\n{row}\n{row}\n{row}\n{row}\n{row}\n{row}",
}
FORMS = {"exponent": ".5E", "D": ".5E", "signed": "+.4e", "integers": ".0f",
         "trailing point": ".0f", "thousands": ",.1f", "integer thousands": ",.0f"}  # fmt: skip
COUNTS = ("Record Length{s}{n}", "Segments{s}1{s}SegmentSize{s}{n}", "DATA COUNT{s}{n}",
          "Points{s}{n}", "Record Length{s}Analog:{n}", "#Samples: {n}")  # fmt: skip
RATES = {
    "interval": "Sample Interval{s}{dt}",
    "interval in ms": "Sample Interval{s}{dt_ms} ms",
    "interval, ms": "Sample Interval{s}{dt_ms}{s}ms",
    "rate": "Sample Rate{s}{rate}{s}Hz",
    "#rate": "#Sample rate: {rate}Hz",
    "rate in kHz": "Sampling Rate: {rate_khz} kHz",
}
FOOTERS = {
    "blank lines": "{end}{end}",
    "separators": "{s}{s}{end}",
    "blank row": "{empty}{end}",
    "text": "End of data{end}",
    "mean": "Mean{s}{x}{end}",
    "end of file sign": "\x1a",
}
MIDDLES = {
    "comment": "# marker {a}",
    "blank line": "",
    "text": "Pause of {a} s",
    "empty row": "{empty}",
    "names again": "{names}",
    "quote": '"',
}


@dataclass(frozen=True)
class Dialect:
    """Choices of one table."""

    seed: int = 1
    """Seed of values and names."""
    columns: str = "tv"
    """n: number of the row, t: time, v: velocity, f: force, x: another quantity."""
    imported: str = "v"
    rows: int = 12
    rate: int = 1000
    separator: str = ","
    decimal: str = "."
    end: str = "\n"
    preamble_end: str = ""
    """Line ends before the rows; empty for the same."""
    encoding: str = "utf-8"
    numbers: str = "fixed"
    group: str = ""
    """Sign between thousands."""
    constant: bool = False
    header: str = "names"
    """none, names, (u), [u], / u, row of units, commented, keysight."""
    unit_given: bool = True
    """Whether the user gives the units although the header states them."""
    quotes: str = ""
    """Empty, names, or all."""
    time: str = "s"
    """s, ms, negative, unix, iso, local, clock; ignored: the user gives the rate."""
    rate_given: bool = False
    preamble: tuple[str, ...] = ()
    sign: str = ""
    """Sign of a comment before each line of the preamble."""
    odd_text: str = ""
    odd: str = "\x0b"
    states_rate: str = ""
    count: str = ""
    missing: int = 0
    """Rows that were lost after the number of rows was written."""
    trailing: str = ""
    """Separator at the end of: rows, names, both; Comment: a name without cells, as of LabVIEW."""
    footer: str = ""
    middle: str = ""
    bad: str | None = None
    """Cell in the place of a number."""
    bad_column: str = "v"
    place: float = 0.5
    """Place of the line in the middle, or of the bad cell, as fraction of the rows."""
    last_end: bool = True
    cut: int = 0
    """Characters that are missing at the end, besides the line end."""


@dataclass(frozen=True)
class Table:
    """A written table and its truth."""

    data: bytes
    names: dict[str, list[str]]
    """What a user may call the column of each kind, best first."""
    units: dict[str, str]
    """Units that the user knows."""
    values: dict[str, np.ndarray]
    """True values of the imported channels in m/s and N, shape (rows,)."""
    rate: float
    rate_error: float
    """Largest error of the rate by the rounding of the times, Hz."""
    times: list[Decimal]
    """Times of the rows in s, on the axis of the file."""


def draw(seed: int) -> Dialect:
    """Choose a table: mostly plain, with up to two oddities."""
    random = Random(seed)
    columns = random.choice(
        ("tv", "tvf", "tvf", "tv", "vf", "v", "f", "tf", "ntvf", "tvx", "xtvfx", "ftv", "nvxtf")
    )
    channels = [c for c in "vf" if c in columns]
    imported = "".join(channels) if random.random() < 0.6 else random.choice(channels)
    separator = random.choice((",", ",", ",", ";", ";", "\t", "\t", *BLANKS))
    plain = Dialect(
        seed=seed,
        columns=columns,
        imported=imported,
        rows=random.choice((2, 3, 5, *range(8, 61))),
        rate=random.choice((250, 500, 1000, 1000, 2000, 10000)),
        separator=separator,
        decimal="," if separator != "," and random.random() < 0.4 else ".",
        end=random.choice(("\n", "\n", "\r\n", "\r\n", "\r")),
        encoding=random.choice(("utf-8", "utf-8", "utf-8-sig", "cp1252")),
        numbers=random.choice(("fixed", "fixed", "exponent", "signed", "integers")),
        header=random.choice(("names", "names", "none", "(u)", "[u]", "/ u", "row of units")),
        unit_given=random.random() < 0.5,
        time=random.choice(("s", "ms", "negative", "s", "ms", "iso")),
        rate_given=random.random() < 0.3,
        preamble=tuple(random.choices(PREAMBLE, k=random.choice((0, 0, 1, 2, 4, 8, 15)))),
    )
    for choose in random.sample(ODDITIES, random.choice((0, 0, 1, 1, 1, 2))):
        plain = replace(plain, **choose(random))
    return _possible(plain)


def _bad(random: Random) -> dict:
    return {
        "bad": random.choice(BAD_CELLS),
        "bad_column": random.choice("vvftx"),
        "place": random.choice((0.0, 0.1, 0.2, 0.5, 0.9, 1.0)),
    }


ODDITIES: list[Callable[[Random], dict]] = [
    _bad,
    _bad,
    lambda r: {"cut": r.randint(0, 12), "last_end": False},
    lambda r: {"count": r.choice(COUNTS), "missing": r.choice((0, 1, 5))},
    lambda r: {"middle": r.choice(list(MIDDLES)), "place": r.choice((0.05, 0.2, 0.5, 0.9))},
    lambda r: {"footer": r.choice(list(FOOTERS))},
    lambda r: {"footer": r.choice(("text", "mean", "blank row")), "time": "ignored"},
    lambda r: {"trailing": r.choice(("rows", "names", "both", "Comment"))},
    lambda r: {"odd_text": "separator", "odd": r.choice("\x0b\x0c\x1c\x85\u2028")},
    lambda r: {"odd_text": r.choice(list(ODD_TEXTS))},
    lambda r: {"states_rate": r.choice(list(RATES)), "time": "ignored"},
    lambda r: {"time": r.choice(("unix", "clock", "local", "ignored"))},
    lambda r: {"group": r.choice((",", "'", " ", "\xa0", "\u202f")), "numbers": "thousands"},
    lambda r: {"group": ",", "numbers": "integer thousands", "time": "s"},
    lambda r: {"numbers": r.choice(("D", "bare", "padded", "minus", "trailing point"))},
    lambda r: {"quotes": r.choice(("names", "all"))},
    lambda r: {"encoding": r.choice(("utf-16", "latin-1")), "preamble": ("Temp. {x} °C, µ",)},
    lambda r: {"separator": r.choice(("|", ", "))},
    lambda r: {"separator": ",", "decimal": ",", "quotes": r.choice(("", "all"))},
    lambda r: {"header": r.choice(("commented", "keysight"))},
    lambda r: {"sign": r.choice(("#", "%", ";", "//")), "preamble": PREAMBLE[:5]},
    lambda r: {"constant": True},
    lambda r: {"preamble_end": r.choice(("\n", "\r\n", "\r")), "preamble": PREAMBLE[:3]},
    lambda r: {"separator": r.choice(BLANKS), "header": "(u)"},
    lambda r: {"last_end": False},
]


def commas(d: Dialect) -> bool:
    """Return whether the only delimiter that can be seen is also a sign inside the numbers."""
    single = len(d.columns) == 1 or d.separator.strip() == ","
    return "," in (d.decimal, d.group) and single and d.quotes != "all"


def _possible(d: Dialect) -> Dialect:
    """Remove choices that exclude each other, or whose truth nobody can see in the file."""
    imported = "".join(kind for kind in d.imported if kind in d.columns)
    d = replace(d, imported=imported or next(kind for kind in "vf" if kind in d.columns))
    for excluded, change in EXCLUDED:
        if excluded(d):
            d = replace(d, **change(d))
    return d


EXCLUDED: list[tuple[Callable[[Dialect], object], Callable[[Dialect], dict]]] = [
    (lambda d: "t" not in d.columns, lambda d: {"time": "ignored"}),
    # A cell with a blank, or an empty one, is not visible between blanks.
    (lambda d: d.separator in BLANKS, lambda d: {"quotes": "", "trailing": ""}),
    (lambda d: d.separator in BLANKS and d.header == "keysight", lambda d: {"header": "names"}),
    (lambda d: d.separator in BLANKS and d.time == "local", lambda d: {"time": "iso"}),
    (lambda d: d.separator in BLANKS and d.group == " ", lambda d: {"group": "\xa0"}),
    (lambda d: d.group == "," == d.decimal, lambda d: {"group": "."}),
    (lambda d: d.group == "," == d.separator.strip(), lambda d: {"quotes": "all"}),
    # Nothing shows what "1.234" or "1,234" means, without a number of the other kind.
    (
        lambda d: (
            d.numbers == "integer thousands"
            and (d.decimal == "," or d.time not in ("s", "negative", "unix"))
        ),
        lambda d: {"numbers": "thousands"},
    ),
    (lambda d: "thousands" in d.numbers and not d.group, lambda d: {"numbers": "fixed"}),
    (lambda d: "thousands" not in d.numbers, lambda d: {"group": ""}),
    # Nothing shows what "1,2" means.
    (lambda d: commas(d) and d.header == "none", lambda d: {"header": "names"}),
    (commas, lambda d: {"trailing": ""}),
    (lambda d: d.bad == "" and len(d.columns) == 1, lambda d: {"bad": "OVL"}),
    (
        lambda d: d.header == "none" and d.odd_text in ("numbers", "calibration"),
        lambda d: {"odd_text": ""},
    ),
    (
        lambda d: d.header == "keysight" and (d.columns[0] != "t" or "n" in d.columns),
        lambda d: {"header": "names"},
    ),
    (lambda d: d.header == "keysight" and d.time != "s", lambda d: {"header": "names"}),
    (lambda d: d.bad_column not in d.columns, lambda d: {"bad_column": d.imported[0]}),
    (lambda d: not d.count or d.rows < d.missing + 2, lambda d: {"missing": 0}),
    # The data are the longest table.
    (lambda d: d.odd_text == "calibration" and d.rows < 9, lambda d: {"odd_text": ""}),
    (lambda d: d.odd_text != "separator", lambda d: {"odd": "\x0b"}),
    (lambda d: not d.last_end, lambda d: {"footer": ""}),
    (
        lambda d: (
            d.encoding in ("cp1252", "latin-1")
            and (d.bad == "∞" or d.numbers == "minus" or d.group == "\u202f" or d.odd > "~")
        ),
        lambda d: {"encoding": "utf-8"},
    ),
]


def simpler(d: Dialect) -> Iterator[Dialect]:
    """Yield dialects of which one choice is the plainest one, then shorter ones."""
    for field in fields(d):
        if field.name != "rows" and getattr(d, field.name) != field.default:
            yield _possible(replace(d, **{field.name: field.default}))
    for preamble in ([p] for p in d.preamble if len(d.preamble) > 1):
        yield replace(d, preamble=tuple(preamble))
    for rows in (2, 3, 4, 6, 8, 12, 20, d.rows - 1):
        if 1 < rows < d.rows:
            yield replace(d, rows=rows)


class _Writer:
    """Makes the cells and lines of one dialect."""

    def __init__(self, d: Dialect):
        self.d = d
        self.random = Random(d.seed)
        big = d.numbers in ("integers", "thousands", "integer thousands", "trailing point")
        self.units = {"v": "um/s", "f": "mN"} if big else self.random.choice(
            ({"v": "m/s", "f": "N"}, {"v": "mm/s", "f": "mN"}, {"v": "V", "f": "V"})
        )  # fmt: skip
        self.units |= {"x": "°C", "n": "", "t": "ms" if d.time == "ms" else "s"}
        names = {"v": ("v", "Speed", "velocity"), "f": ("F", "Load", "force"), "t": ("t", "Time"),
                 "n": ("Index",), "x": ("Temp", "Ä")}  # fmt: skip
        self.names = {kind: self.random.choice(names[kind]) for kind in d.columns}

    def number(self, value: float) -> tuple[str, str]:
        """Return the cell of a number, and the number as Python reads it."""
        style = self.d.numbers
        text = format(value, FORMS.get(style, ".5f"))
        true = text.replace(",", "")
        if style == "D":
            text = text.replace("E", "D")
        elif style == "bare":
            text = text.replace("0.", ".", 1) if text.startswith(("0.", "-0.")) else text
        elif style == "padded":
            text = f"  {text} "
        elif style == "minus":
            text = text.replace("-", "\u2212")
        elif style == "trailing point":
            text += "."
        signs = str.maketrans({",": self.d.group or ",", ".": self.d.decimal})
        return text.translate(signs), true

    def series(self, kind: str) -> tuple[list[str], np.ndarray]:
        """Return the cells of a column and their true values in SI units."""
        d, random = self.d, self.random
        low, high = {"v": (-0.004, 0.09), "f": (-0.05, 2.9), "x": (20.0, 22.0)}[kind]
        bump = np.sin(np.pi * np.arange(d.rows) / max(d.rows - 1, 1)) ** 2
        values = low + (high - low) * (0.1 + 0.8 * bump + 0.1 * np.array(_noise(random, d.rows)))
        if d.constant:
            values[:] = values[0]
        unit = self.units[kind]
        volts = {"v": 0.025, "f": 1.0}.get(kind, 1.0)  # m/s and N per volt, of the packaged rig
        factor = {"mm/s": 1e-3, "um/s": 1e-6, "mN": 1e-3, "V": volts}.get(unit, 1.0)
        cells = [self.number(float(value / factor)) for value in values]
        return [cell for cell, _ in cells], np.array([float(true) for _, true in cells]) * factor

    def times(self) -> tuple[list[str], list[Decimal], float]:
        """Return the cells of the times, the times in s, and their rounding in s."""
        d = self.d
        start = {"negative": Decimal("-0.004"), "unix": UNIX}.get(d.time, Decimal(0))
        steps = [Decimal(i) / d.rate for i in range(d.rows)]
        times = [start + step for step in steps]
        if d.time in ("iso", "local", "clock"):
            form = {"iso": "%Y-%m-%dT%H:%M:%S.%f+00:00", "local": "%Y-%m-%d %H:%M:%S.%f"}
            first = datetime.fromtimestamp(int(UNIX), UTC)
            cells = [
                (first + timedelta(microseconds=int(step * 10**6))).strftime(
                    form.get(d.time, "%H:%M:%S.%f")
                )
                for step in steps
            ]
            return cells, times, 0.0
        scale = 1000 if d.time == "ms" else 1
        form = "+.7e" if d.numbers in ("exponent", "D") and d.time != "unix" else ".4f"
        form = ".0f" if d.numbers == "integers" and scale >= d.rate else form
        cells = [format(float(time * scale), form).replace(".", d.decimal) for time in times]
        return cells, times, float(np.spacing(float(times[-1])))

    def lines_of_names(self) -> list[str]:
        """Return the header."""
        d, kinds = self.d, self.d.columns
        bare = [self.names[kind] for kind in kinds]
        units = [self.units[kind] for kind in kinds]
        forms = {"(u)": "{} ({})", "[u]": "{}[{}]", "/ u": "{}/{}"}
        if d.header == "none":
            return []
        if d.header == "keysight":
            words = {"s": "second", "V": "Volt"}
            numbers = map(str, range(1, len(kinds)))
            return [self.row(["x-axis", *numbers]), self.row([words.get(u, u) for u in units])]
        if d.header in forms:
            form = forms[d.header]
            bare = [form.format(n, u) if u else n for n, u in zip(bare, units, strict=True)]
        ends = {"names": d.separator, "both": d.separator, "Comment": f"{d.separator}Comment"}
        end = ends.get(d.trailing, "")
        lines = [self.row(bare, names=True) + end]
        if d.header == "row of units":
            lines.append(self.row([unit or "-" for unit in units], names=True) + end)
        return ["# " + lines[0]] if d.header == "commented" else lines

    def called(self) -> dict[str, list[str]]:
        """Return what a user may call each column: as the file, without the unit, by number."""
        d, found = self.d, {}
        for i, kind in enumerate(d.columns):
            name, unit = self.names[kind], self.units[kind]
            if d.header == "keysight":
                found[kind] = ["x-axis" if i == 0 else str(i)]
            elif d.header == "none":
                found[kind] = [str(i + 1)]
            else:
                form = {"(u)": "{} ({})", "[u]": "{}[{}]", "/ u": "{}/{}"}.get(d.header, "{}")
                found[kind] = [form.format(name, unit) if unit else name, name, str(i + 1)]
        return found

    def row(self, cells: list[str], names: bool = False) -> str:
        """Return the line of some cells."""
        d = self.d
        if d.quotes == "all" or (d.quotes == "names" and names):
            cells = [f'"{cell}"' for cell in cells]
        if d.separator == BLANKS[1]:
            cells = [f"{cell:>12}" for cell in cells]
        return d.separator.join(cells)


def _noise(random: Random, n: int) -> list[float]:
    return [random.random() for _ in range(n)]


def write(d: Dialect) -> Table:
    """Write a table, and return it with its truth."""
    writer = _Writer(d)
    time_cells, times, rounding = writer.times()
    columns: dict[int, list[str]] = {}
    values = {}
    for i, kind in enumerate(d.columns):
        if kind == "t":
            columns[i] = time_cells
        elif kind == "n":
            columns[i] = [str(row) for row in range(1, d.rows + 1)]
        else:
            columns[i], true = writer.series(kind)
            if kind in d.imported:
                values[kind] = true
    at = min(int(d.place * d.rows), d.rows - 1)
    if d.bad is not None:
        columns[d.columns.index(d.bad_column)][at] = d.bad.replace("{s}", d.separator)
    end = d.separator if d.trailing in ("rows", "both") else ""
    rows = [writer.row(list(cells)) + end for cells in zip(*columns.values(), strict=True)]
    text = _assemble(writer, rows, at)
    span = float(times[-1] - times[0])
    return Table(
        data=text.encode(d.encoding),
        names=writer.called(),
        units={kind: writer.units[kind] for kind in d.columns},
        values=values,
        rate=float(d.rate),
        rate_error=d.rate * (1e-9 + (2 * rounding / span if d.time != "ignored" else 0)),
        times=times,
    )


def _assemble(writer: _Writer, rows: list[str], at: int) -> str:
    d = writer.d
    numbers = [writer.number(x)[0] for x in (7.25, *[3.5] * (len(d.columns) - 1))]
    words = {
        "s": d.separator, "a": 3, "b": 25, "x": f"0{d.decimal}05", "n": d.rows, "odd": d.odd,
        "row": writer.row(numbers), "dt": f"{1 / d.rate:.6E}".replace(".", d.decimal),
        "dt_ms": f"{1000 / d.rate:g}".replace(".", d.decimal),
        "rate": d.rate, "rate_khz": f"{d.rate / 1000:g}".replace(".", d.decimal), "end": d.end,
        "empty": d.separator * (len(d.columns) - 1),
    }  # fmt: skip
    names = writer.lines_of_names()
    preamble = [line.format(**words) for line in d.preamble]
    for choices, choice in ((RATES, d.states_rate), ({d.count: d.count}, d.count)):
        preamble += [choices[choice].format(**words)] if choice else []
    if d.odd_text:
        preamble += ODD_TEXTS[d.odd_text].format(**words).split("\n")
    words["names"] = names[-1] if names else "Part 2"
    if d.middle:
        rows = [*rows[:at], MIDDLES[d.middle].format(**words), *rows[at:]]
    rows = rows[: len(rows) - d.missing]
    before = [d.sign + line for line in preamble] + names
    text = "".join(line + (d.preamble_end or d.end) for line in before) + d.end.join(rows) + d.end
    if not d.last_end:
        text = text[: len(text) - len(d.end) - d.cut].rstrip("\r\n")
    return text + (FOOTERS[d.footer].format(**words) if d.footer else "")
