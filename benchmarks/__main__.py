"""Run all benchmarks, or those that are named, and rewrite the page of figures."""

import importlib
import sys

from benchmarks.figures import table, write_page

ALL = (
    "press",
    "planner",
    "model",
    "levels",
    "string",
    "calculix",
    "parts",
    "trade",
    "recording",
    "acquisition",
    "learning",
    "phases",
    "report",
    "identify",
    "campaign",
    "imports",
)


def main() -> None:
    names = sys.argv[1:] or ALL
    tables = []
    for name in names:
        module = importlib.import_module(f"benchmarks.{name}")
        tables.append(table(module.__doc__.splitlines()[0].rstrip("."), module.run()))
        print(tables[-1])
    if tuple(names) == ALL:
        write_page(tables)


main()
