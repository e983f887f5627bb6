"""A measured figure, and the page of figures."""

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol, TypeVar

from sautereau.sim_backend.trade.study import machine

T = TypeVar("T")
RUNS = 21  # Repetitions of a timed function
UPPER, LOWER = "limit", "at least"
"""Names of the references that are limits; every other one is a peer."""
PAGE = Path(__file__).parents[1] / "docs" / "figures.md"


class BenchmarkFault(Exception):  # noqa: N818
    """What a benchmark measured is not what it says: a result is wrong."""


def check(holds: bool, fault: str) -> None:
    """Refuse to report figures of wrong results.

    Raises:
        BenchmarkFault: It does not hold; the text says what is wrong.
    """
    if not holds:
        raise BenchmarkFault(fault)


@dataclass(frozen=True)
class Figure:
    """One measured number beside its limit, or beside a peer measured in the same run."""

    what: str
    value: float
    unit: str
    against: str
    """Name of the reference: `UPPER`, `LOWER`, or a peer's name."""
    reference: float
    """Value of the limit or peer, in the same unit."""

    @property
    def missed(self) -> bool:
        """Whether the value is beyond its limit; NaN, for a figure not measured, is not."""
        if self.against == UPPER:
            return bool(abs(self.value) > self.reference)
        return bool(self.against == LOWER and self.value < self.reference)

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit not in ("", "1") else ""
        ratio = f"{self.value / self.reference:.3g}" if self.reference else "-"
        return (
            f"| {self.what} | {self.value:.4g}{unit} | {self.against}: {self.reference:.4g}{unit}"
            f" | {ratio}{' MISSED' * self.missed} |"
        )


def timed(work: Callable[..., T], *arguments, **options) -> tuple[float, T]:
    """Return the time [s] of one call, and its result."""
    start = time.perf_counter()
    result = work(*arguments, **options)
    return time.perf_counter() - start, result


def median_time(work: Callable[[], object], runs: int = RUNS) -> float:
    """Return the median time [s] of several runs, after a warm-up run."""
    work()
    return statistics.median(timed(work)[0] for _ in range(runs))


HEAD = "| what | measured | against | ratio |\n|---|---|---|---|"  # Head of a table of figures


class Row(Protocol):
    """One row of a benchmark's table; its text is in Markdown."""

    @property
    def missed(self) -> bool:
        """Whether a value is beyond its limit."""
        ...


def table(title: str, figures: Sequence[Row], head: str = HEAD) -> str:
    """Return a titled Markdown table, with the day and the machine below it."""
    measured = f"Measured on {datetime.now(UTC).date().isoformat()}; {machine()}."
    return "\n".join([f"## {title}", "", head, *map(str, figures), "", measured])


def write_page(tables: Sequence[str], titles: Sequence[str]) -> None:
    """Write tables to the page of figures; each replaces the older one of the same title.

    Args:
        tables: As `table` returns them.
        titles: Titles of all benchmarks, in the order of the page; other tables are removed.
    """
    page = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
    found = {_title(text): text.strip() for text in page.split("\n## ")[1:]}
    found |= {_title(text): text.removeprefix("## ").strip() for text in tables}
    kept = [f"## {found[title]}" for title in titles if title in found]
    how = (
        "Written by `make bench`, or one by one: `python -m benchmarks --write NAME`. A figure"
        "\nbeyond its limit is marked MISSED."
    )
    PAGE.write_text("\n\n".join(["# Figures", how, *kept]) + "\n", encoding="utf-8")


def _title(text: str) -> str:
    return text.removeprefix("## ").partition("\n")[0].strip()
