"""Run all benchmarks but the longest, or those that are named, and print their figures.

The figures of all, or of those named after `--write`, are written to the page of figures. A
figure beyond its limit is marked MISSED; the exit status is then 1.
"""

import argparse
import ast
import importlib
import os
import sys
from pathlib import Path

# As the commands do: other threads of BLAS wait in busy loops, which counts as processor time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from benchmarks.figures import HEAD, table, write_page

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
    "load",
    "learning",
    "speed",
    "phases",
    "independent_phases",
    "report",
    "identify",
    "touch",
    "campaign",
    "imports",
    "transient",
)
LONG = ("identify_many", "expected", "stability", "stranger", "page")
"""Benchmarks of many minutes of processor time. They run only if they are named."""


def main(arguments: list[str]) -> int:
    """Run the benchmarks; return the exit status."""
    parser = argparse.ArgumentParser("python -m benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"one of {', '.join(ALL + LONG)}")
    parser.add_argument("--write", action="store_true", help="write the figures of those named")
    given = parser.parse_intermixed_args(arguments)
    names: list[str] = given.names
    if unknown := [name for name in names if name not in ALL + LONG]:
        parser.error(f"unknown benchmark: {', '.join(unknown)}; there are {', '.join(ALL + LONG)}")
    missed = 0
    for name in names or ALL:
        benchmark = importlib.import_module(f"benchmarks.{name}")
        figures = benchmark.run()
        found = table(title(name), figures, getattr(benchmark, "HEAD", HEAD))
        print(found, flush=True)
        missed += sum(figure.missed for figure in figures)
        if not names or given.write:
            write_page([found], [title(each) for each in ALL + LONG])
    if missed:
        print(f"{missed} MISSED limit{'s' * (missed > 1)}", file=sys.stderr)
    return int(missed > 0)


def title(name: str) -> str:
    """Return the heading of a benchmark's figures: the first line of its docstring."""
    module = ast.parse((Path(__file__).parent / f"{name}.py").read_text(encoding="utf-8"))
    return (ast.get_docstring(module) or name).splitlines()[0].rstrip(".")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
