"""Run benchmarks, all of them or those that are named, and print what they have measured.

All of them, or those that are named after `--write`, go onto the page of figures.
"""

import ast
import importlib
import sys
from pathlib import Path

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
    names = [name for name in sys.argv[1:] if name != "--write"]
    for name in names or ALL:
        found = table(title(name), importlib.import_module(f"benchmarks.{name}").run())
        print(found, flush=True)
        if not names or "--write" in sys.argv:
            write_page([found], [title(each) for each in ALL])


def title(name: str) -> str:
    """Return the heading of a benchmark's figures, its first line."""
    module = ast.parse((Path(__file__).parent / f"{name}.py").read_text(encoding="utf-8"))
    return (ast.get_docstring(module) or name).splitlines()[0].rstrip(".")


main()
