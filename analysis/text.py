"""Phrases, tables and line breaks that all texts share."""

import math
import re
import textwrap
from collections.abc import Collection, Iterable, Sequence
from typing import TYPE_CHECKING

from sautereau.rig.quantities import DISPLAYED

if TYPE_CHECKING:
    from sautereau.trajectory.checks import Check

IN_RIG = DISPLAYED | {
    **{"kg": (1e3, "g"), "N": (1e3, "mN"), "Pa": (1e-9, "GPa"), "N*m": (1e3, "mN m")},
    "N*m*s/rad": (1e3, "mN m s/rad"),
}  # Factor and unit in which rig files state a quantity, by its SI unit
SOME_SIMULATED = "SIMULATED: at least one of these presses is simulated"
"""First line of the text on presses of which any was made on a stand-in."""
OF_DIFFERENCES = "95 % intervals of presses and fit (gains cancel)"
"""What text and plots say of intervals that differences have."""
WIDTH = 80  # Columns of the narrowest usual terminal, to which texts are wrapped
NAMED = 3  # Largest number of names that are listed before a text that applies to all of them
_PLURALS = {"press": "presses", "plectrum": "plectra"}


def counted(count: int, noun: str) -> str:
    """Return a number with its noun in the singular or the plural: `1 press`, `2 plectra`."""
    return f"{count} {noun if count == 1 else _PLURALS.get(noun, f'{noun}s')}"


def listed(names: Sequence[str] | str) -> Sequence[str]:
    """Return names as a list, also those of one text, which are separated by commas."""
    if not isinstance(names, str):
        return names
    return [name.strip() for name in names.split(",") if name.strip()]


def grouped(said: Iterable[tuple[object, str]], noun: str) -> list[str]:
    """Return texts about named things, equal texts first and once: `4 files (a, b, ...): TEXT`.

    Args:
        said: Names with their texts.
        noun: What the names are of, in the singular.
    """
    names: dict[str, list[str]] = {}
    for name, text in said:
        names.setdefault(text, []).append(str(name))
    lines = []
    for text, own in sorted(names.items(), key=lambda item: len(item[1]) == 1):
        listed = ", ".join([*own[:NAMED], *["..."] * (len(own) > NAMED)])
        lines.append(
            f"{counted(len(own), noun)} ({listed}): {text}" if own[1:] else f"{listed}: {text}"
        )
    return lines


def remark_lines(said: Iterable[tuple[object, str]], listed: bool, where: str) -> list[str]:
    """Return remarks on presses as lines, or else one line with their number, if there are any.

    Args:
        said: Names of presses with their remarks.
        listed: Whether to list them.
        where: What lists them otherwise.
    """
    remarks = list(said)
    if listed:
        return [f"remark: {text}" for text in grouped(remarks, "press")]
    return [f"{counted(len(remarks), 'remark')}, listed by {where}"] * bool(remarks)


def table(
    rows: Iterable[Sequence[str]], *, left: Collection[int] = (0,), indent: int = 0, gap: int = 2
) -> list[str]:
    """Return rows of cells as lines of aligned columns.

    Args:
        rows: Cells of each row, the column heads first.
        left: Columns that are aligned on the left; the others are aligned on the right.
        indent: Number of spaces before the first column.
        gap: Number of spaces between columns.
    """
    rows = list(rows)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        " " * indent
        + (" " * gap)
        .join(
            cell.ljust(width) if number in left else cell.rjust(width)
            for number, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        .rstrip()
        for row in rows
    ]


def wrapped(text: str) -> str:
    """Return a text whose lines of prose are broken at spaces, to fit into `WIDTH` columns.

    A line with one gap of several spaces, such as `label:   text`, continues below its text. Kept
    are lines with more gaps, which are rows of tables, and lines of two words: `report: PATH`.
    """
    return "\n".join(_wrapped_line(line) for line in text.split("\n"))


def _wrapped_line(line: str) -> str:
    gaps = [gap.end() for gap in re.finditer(r"(?<=\S) {2,}", line)]
    # So many spaces at the start are an empty first column of a table.
    empty = len(line) - len(line.lstrip()) >= 12
    if len(line) <= WIDTH or empty or len(gaps) > 1 or len(line.split()) <= 2:
        return line
    indent = gaps[0] if gaps else len(line) - len(line.lstrip()) + 2
    return textwrap.fill(
        line, WIDTH, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
    )


def quantity_in_rig(value: float, unit: str, digits: int = 4) -> str:
    """Return an SI value in the unit in which rig files state it."""
    scale, name = _in_rig(unit, value)
    return f"{value * scale:.{digits}g} {name}".strip()


def in_rig_units(
    value: float, std: float | None, unit: str, stds: Sequence[float | None] = ()
) -> tuple[str, list[str], str]:
    """Return a value with the digits that its uncertainty leaves, and uncertainties, as rig files.

    Args:
        value: SI.
        std: SI, its standard uncertainty; None if it is unknown.
        unit: SI.
        stds: SI, the uncertainties.

    Returns:
        The value, the uncertainties with two digits, or `-`, and their unit.
    """
    scale, name = _in_rig(unit, value)
    largest = max(abs(value), std or 0.0) * scale
    far = 0 < largest < 1e-3 or 1e5 <= largest < math.inf
    power = math.floor(math.log10(largest)) if far else 0
    scale, exponent = scale / 10.0**power, f"e{power}" if power else ""
    shown = (std or 0.0) * scale
    digits = max(0, 1 - math.floor(math.log10(shown))) if 0 < shown < math.inf else 4
    spreads = ["-" if each is None else f"{each * scale:.2g}{exponent}" for each in stds]
    return f"{value * scale:.{min(digits, 9)}f}{exponent}", spreads, name


def _in_rig(unit: str, value: float) -> tuple[float, str]:
    """Return the factor from an SI unit to that of rig files, and its text.

    A value of 10,000 or more in that unit, as a string's tension in mN, has the SI unit.
    """
    scale, name = IN_RIG.get(unit, (1.0, ""))
    large = not name or abs(value) * scale >= 1e4
    return (1.0, unit.replace("**", "^").replace("*", " ")) if large else (scale, name)


def concise(value: float, std: float | None, decimals: int) -> str:
    """Return a value with its standard uncertainty in units of the last digit, as 109.28(14).

    That is the notation of section 7.2.2 of the Guide to the expression of uncertainty in
    measurement (JCGM 100:2008).

    Args:
        std: In the unit of the value; None where it is unknown.
        decimals: Most of the value, and those of a value whose uncertainty is unknown.
    """
    if not std or not math.isfinite(std):
        return f"{value:.{decimals}f}"
    power = int(f"{std:.1e}".partition("e")[2])  # of two digits, after rounding
    shown = min(decimals, max(0, 1 - power))
    return f"{value:.{shown}f}({max(1, round(std * 10**shown))})"


def percent(ratio: float) -> str:
    """Return a signed ratio in per cent: `-6.6 %`, `+0.12 %`."""
    return f"{100 * ratio:+.{1 if abs(ratio) >= 0.01 else 2}f} %"


def relative_margin(check: "Check") -> float:
    """Return the margin [1] over the limit; infinite where a limit of 0 is kept."""
    if math.isnan(check.margin):
        return -math.inf
    if check.limit == 0:
        return math.copysign(math.inf, check.margin) if check.margin else 0.0
    return check.margin / abs(check.limit)


def check_cells(check: "Check") -> tuple[str, ...]:
    """Return name, value in the unit of its limit, limit, margin, and whether the check fails."""
    plain = "" if check.unit == "1" else check.unit.replace("*", " ")
    scale, unit = DISPLAYED.get(check.unit, (1.0, plain))

    relative = relative_margin(check)
    margin = f"{100 * relative:.1f} %" if math.isfinite(relative) else "-"
    limit = f"{'>=' if check.at_least else '<='} {check.limit * scale:.4g} {unit}".rstrip()
    verdict = "" if check.holds else "FAILS"
    return check.name, f"{check.value * scale:.4g}", limit, margin, verdict


def rounded(quantity: object, digits: int = 6) -> str:
    """Return a quantity with a shorter number: `9.999999999999999e-06 s` as `1e-05 s`.

    A text that does not begin with a number is returned unchanged.
    """
    number, _, unit = str(quantity).partition(" ")
    try:
        return f"{float(number):.{digits}g} {unit}".strip()
    except ValueError:
        return str(quantity)


def visible(text: str, kept: str = "\n") -> str:
    """Return a text with invisible characters written out, except those that are kept."""
    return "".join(
        c
        if c.isprintable() or c in kept
        else (f"\\x{ord(c):02x}" if ord(c) < 0x100 else f"\\u{{{ord(c):x}}}")
        for c in text
    )
