"""Readers over other people's libraries, run as a program of their own: see `__main__`.

Here is what a reader returns for a file, and its limits.
"""

import numpy as np

Found = tuple[dict[str, np.ndarray], dict[str, dict[str, str | float]], str | None]
"""Arrays; what the file says of each: `unit`, `rate` (Hz), `start` (s), `date` of its time 0, and
the attributes that are `unknown`; the document of an export."""
MOST_COLUMNS = 64  # Limit of the columns of a matrix; a larger one is a picture and not a table


def refuse(values: float, most: int) -> None:
    """Refuse a file that holds more values than the limit."""
    if values > most:
        raise ValueError(f"it holds {values:.0f} values, more than the limit MOST_VALUES = {most}")


def refuse_cut(what: str, there: int, stated: int) -> None:
    """Refuse a file that states more values than it has."""
    if there < stated:
        raise ValueError(f"it is cut off: {what} has {there} of {stated} values")


def even(step: float, start: float, unit: str) -> dict[str, str | float]:
    """Return the properties of a channel whose values are evenly spaced, as far as they are known.

    Args:
        step: s, between two values.
        start: s, of the first one.
        unit: As the file writes it.
    """
    known: dict[str, str | float] = {"unit": unit.strip()} if unit.strip() else {}
    if np.isfinite(step) and step > 0:
        known["rate"] = float(f"{1 / step:.12g}")
    return known | ({"start": float(start)} if np.isfinite(start) else {})
