"""Tables in files beside the modules that use them."""

import csv
from pathlib import Path


def table_beside(module: str) -> list[list[str]]:
    """Return the rows below the head of ``NAME.csv``, for the `__file__` ``NAME.py``."""
    with Path(module).with_suffix(".csv").open(encoding="utf-8", newline="") as file:
        return list(csv.reader(file))[1:]
