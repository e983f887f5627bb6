"""How forces act in a step, and events inside one, located on the parabola of its motion."""

from collections.abc import Callable
from typing import NamedTuple

from scipy.optimize import brentq

TOLERANCE = 1e-12  # ms, of an event's time


class Kick(NamedTuple):
    """How the forces at the end of a step act, for half of it and half of the next one."""

    ahead: float
    """ms, the next step."""
    step: float
    """ms, of the engine, which applies them."""
    fraction: float
    """Dimensionless, of the forces to apply in it."""


class Event(NamedTuple):
    """A possible change of mode within a step."""

    margin: Callable[[float], float]
    """Guard function of the time [ms]; negative once the event has occurred."""
    change: Callable[[float], None]
    """Applies the change, at a simulated time [s]."""
    impact: bool = False
    """Whether velocities jump in it."""


def earliest(possible: list[Event], drift: float) -> tuple[float, Event | None]:
    """Return the time [ms] of the first event within a drift [ms], and the event.

    Returns:
        The drift itself and None if there is no event.
    """
    time, first = drift, None
    for event in possible:
        if event.margin(time) >= 0:
            continue
        if event.margin(0.0) <= 0:
            return 0.0, event
        found: float = brentq(event.margin, 0.0, time, xtol=TOLERANCE)  # pyright: ignore
        time, first = found, event
    return time, first
