"""Answers as JSON holds them: without what differs between runs, machines and versions."""

import dataclasses
import math
import re
from pathlib import Path
from typing import Any

import numpy as np

DIGITS = 10  # Of a stored float: more than the tightest tolerance needs
PACKAGE = str(Path(__file__).parents[2])  # The folder of the source tree, which texts name
VARIABLE = (
    (r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|[+-]\d\d:\d\d)?", "DATE"),
    (r"\d{4}-\d\d-\d\d( \d\d:\d\d(:\d\d)?)?", "DATE"),
    (r"/dev/pts/\d+|tcp://127\.0\.0\.1:\d+", "PORT"),
    (r"127\.0\.0\.1:\d+", "ADDRESS"),
    (r"\b[0-9a-f]{32}\b", "ID"),
    (r"\b[0-9a-f]{64}\b", "SHA-256"),
    (r"\b0x[0-9a-f]{6,}\b", "MEMORY"),
    (r"(?m)^software: .*(\n +\S.*)*", "software: VERSIONS"),
    (r"sautereau \d+\.\d+\.\d+\S*", "sautereau VERSION"),
    (r"\d+ characters per second", "N characters per second"),
    (r"/tmp/[\w./-]*", "TEMPORARY"),
)
"""What varies in a text, and what stands for it."""
_VARIABLE = tuple((re.compile(pattern), instead) for pattern, instead in VARIABLE)
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?", re.ASCII)


def normal(text: str) -> str:
    """Return a text without dates, ports, identifiers, versions and temporary folders."""
    text = text.replace(PACKAGE, "PACKAGE")
    for pattern, instead in _VARIABLE:
        text = pattern.sub(instead, text)
    return text


def lines_of(text: str) -> list[str]:
    """Return the lines of a text, normalised and without spaces at their ends."""
    return [line.rstrip() for line in normal(text).splitlines()]


def subject(warning: str) -> str:
    """Return what a warning is about: its text before the advice, with # for its numbers."""
    return _NUMBER.sub("#", normal(warning).partition(";")[0])


def plain(value: Any) -> Any:
    """Return a value as JSON holds it, with texts normalised and floats of `DIGITS` digits."""
    if isinstance(value, dict):
        return {str(name): plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(each) for each in value]
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return plain(dataclasses.asdict(value))
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else str(value)
    if isinstance(value, str | Path):
        return normal(str(value))
    return value


def checksum(values: Any) -> dict[str, Any]:
    """Return what `tolerances.same_samples` compares of a signal.

    Two sums with fixed random signs change by every change of a sample. Unlike those of a hash,
    their changes are as small as the samples' own, so that they have a tolerance.

    Args:
        values: Numbers of any shape; NaN counts as -1.

    Returns:
        Number of values, largest magnitude, and both signed sums.
    """
    flat = np.nan_to_num(np.asarray(values, float).ravel(), nan=-1.0, posinf=0.0, neginf=0.0)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (2, len(flat)))
    peak = np.abs(flat).max(initial=0.0)
    return plain({"n": len(flat), "peak": peak, "sums": signs @ flat})
