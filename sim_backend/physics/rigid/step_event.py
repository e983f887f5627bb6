"""What happens inside a step: found on the parabola of its motion."""

from collections.abc import Callable
from dataclasses import dataclass

from scipy.optimize import brentq

TOLERANCE = 1e-12
"""ms, of the moment found."""


@dataclass(frozen=True)
class Happening:
    """Something that may change in a step."""

    margin: Callable[[float], float]
    """What is left of it after a time [ms]; below zero once it has happened."""
    change: Callable[[float], None]
    """Makes the change, at a time [s] on the world's clock."""
    strikes: bool = False
    """Whether speeds jump in it."""


def earliest(watched: list[Happening], drift: float) -> tuple[float, Happening | None]:
    """Return the time [ms] of what happens first within a drift [ms], and what it is.

    Returns:
        The drift itself and None if nothing happens.
    """
    time, first = drift, None
    for happening in watched:
        if happening.margin(time) >= 0:
            continue
        if happening.margin(0.0) <= 0:
            return 0.0, happening
        found: float = brentq(happening.margin, 0.0, time, xtol=TOLERANCE)  # pyright: ignore
        time, first = found, happening
    return time, first
