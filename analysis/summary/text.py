"""Phrases and parts that several summaries share."""

from collections.abc import Collection, Iterable, Sequence
from typing import Any

from sautereau.analysis.session.repeatability import Spread

SOME_SIMULATED = "SIMULATED: at least one of these presses was made on the stand-in"
"""First line of the text on presses of which any was made on a stand-in."""
_PLURALS = {"press": "presses", "plectrum": "plectra"}


def counted(count: int, noun: str) -> str:
    """Return a number with its noun in the singular or the plural: `1 press`, `2 plectra`."""
    return f"{count} {noun if count == 1 else _PLURALS.get(noun, f'{noun}s')}"


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


def part_of(found: object, *names: str) -> dict[str, Any]:
    """Return some attributes of a result by their names."""
    return {name: getattr(found, name) for name in names}


def interval(spread: Spread | None, scale: float = 1.0, digits: int = 4) -> str:
    """Return a figure with its interval: `0.34 (0.3 to 0.38)`; `-` for None."""
    if spread is None:
        return "-"
    value, low, high = (f"{scale * v:.{digits}g}" for v in (spread.value, spread.low, spread.high))
    return f"{value} ({low} to {high})"


def percent(ratio: float) -> str:
    """Return a signed ratio in per cent: `-6.6 %`, `+0.12 %`."""
    return f"{100 * ratio:+.{1 if abs(ratio) >= 0.01 else 2}f} %"
