"""A measured figure, and the page that tables of them are written to."""

import os
import platform
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

RUNS = 21
"""Of what is timed."""
PAGE = Path(__file__).parents[1] / "docs" / "figures.md"


@dataclass(frozen=True)
class Figure:
    """One measured number beside the limit or the peer of the same run."""

    what: str
    value: float
    unit: str
    against: str
    """Name of the limit or peer."""
    reference: float
    """Of the limit or peer, in the same unit."""

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit not in ("", "1") else ""
        return (
            f"| {self.what} | {self.value:.4g}{unit} | {self.against}:"
            f" {self.reference:.4g}{unit} | {self.value / self.reference:.3g} |"
        )


def machine() -> str:
    """Return what this machine is, without its name."""
    cores = os.cpu_count()
    system = f"{platform.system()}, Python {platform.python_version()}"
    return f"{platform.machine()}, {cores} cores, {system}"


def median_time(work: Callable[[], object]) -> float:
    """Return the median time [s] of several runs, after one that warms up."""
    work()
    times = []
    for _ in range(RUNS):
        begun = time.perf_counter()
        work()
        times.append(time.perf_counter() - begun)
    return statistics.median(times)


def table(title: str, figures: Sequence[Figure]) -> str:
    """Return a titled Markdown table, with the day and the machine below it."""
    head = "| what | measured | against | ratio |\n|---|---|---|---|"
    told = f"Measured on {datetime.now(UTC).date().isoformat()}; {machine()}."
    return "\n".join([f"## {title}", "", head, *map(str, figures), "", told])


def write_page(tables: Sequence[str], titles: Sequence[str]) -> None:
    """Put tables on the page of figures, each in the place of the older one of its title.

    Args:
        tables: As `table` returns them.
        titles: Of all benchmarks, in the order of the page; a table of no other stays.
    """
    page = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
    found = {_title(text): text.strip() for text in page.split("\n## ")[1:]}
    found |= {_title(text): text.removeprefix("## ").strip() for text in tables}
    kept = [f"## {found[title]}" for title in titles if title in found]
    how = "Written by `make bench`, or one by one: `python -m benchmarks --write NAME`."
    PAGE.write_text("\n\n".join(["# Figures", how, *kept]) + "\n", encoding="utf-8")


def _title(text: str) -> str:
    return text.removeprefix("## ").partition("\n")[0].strip()
