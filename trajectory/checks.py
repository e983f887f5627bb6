"""A check of a planned press: a value, its limit and the margin."""

from dataclasses import dataclass

import numpy as np

MOVE_BASE = "move arm.base_x or arm.base_z"
SLOWER_PRESS = (
    "lower press.jack_speed, press.run_up_acceleration, run_up_jerk or run_down_acceleration"
)
"""How to fix checks of several kinds that fail."""


@dataclass(frozen=True)
class Check:
    """One quantity against its limit."""

    name: str
    value: float
    """In `unit`."""
    limit: float
    """In `unit`."""
    unit: str
    at_least: bool
    """Whether the limit is a minimum; otherwise it is a maximum."""
    how_to_fix: str
    """What to do if the check fails."""

    @property
    def margin(self) -> float:
        """Distance from the limit, in `unit`; negative if the check fails."""
        return self.value - self.limit if self.at_least else self.limit - self.value

    @property
    def holds(self) -> bool:
        """Whether the value is within its limit; NaN never is."""
        return bool(np.isfinite(self.value)) and self.margin >= 0

    def __str__(self) -> str:
        side = "at least" if self.at_least else "at most"
        verdict = "holds" if self.holds else "fails"
        unit = "" if self.unit == "1" else f" {self.unit}"
        return (
            f"{self.name}: {self.value:.6g}{unit}, {side} {self.limit:.6g}{unit}:"
            f" {verdict} by {abs(self.margin):.3g}{unit}"
        )


def at_most(name: str, value: float, limit: float, unit: str, how_to_fix: str) -> Check:
    """Return a check against a maximum."""
    return Check(name, float(value), float(limit), unit, False, how_to_fix)


def at_least(name: str, value: float, limit: float, unit: str, how_to_fix: str) -> Check:
    """Return a check against a minimum."""
    return Check(name, float(value), float(limit), unit, True, how_to_fix)
