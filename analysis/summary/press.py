"""What was found, as plain values for machines and as lines of text for people."""

from typing import Any

from analysis.compare import Comparison, Departure
from analysis.phases import Phases
from analysis.press import Press

HEADER = (
    f"{'press':<25} {'jack m/s':>9} {'contact ms':>10} {'release ms':>10}"
    f" {'held ms':>8} {'peak N':>7}"
)
"""Of the rows; they fit into 80 columns with the word simulated."""


def press_summary(press: Press, phases: Phases) -> dict[str, Any]:
    """Return one press as JSON would hold it; SI units, None where there is no pluck."""
    first = phases.plucks[0] if phases.plucks else None
    return {
        "path": str(press.path),
        "simulated": press.simulated,
        "start": phases.start,
        "contact": first and first.contact,
        "release": first and first.release,
        "plucks": [
            {
                "contact": p.contact,
                "release": p.release,
                "contact_std": p.contact_std,
                "release_std": p.release_std,
            }
            for p in phases.plucks
        ],
        "speeds": {
            "free": phases.free_speed,
            "held": phases.held_speed,
            "released": phases.released_speed,
        },
        "forces": {
            "contact": first and first.contact_force,
            "peak": first and first.peak_force,
            "step": first and first.force_step,
        },
        "warnings": [*press.warnings, *phases.warnings],
    }


def press_line(press: Press, phases: Phases) -> str:
    """Return one press as a row under `HEADER`."""
    name = press.path.name + (" simulated" if press.simulated else "")
    row = f"{name:<25} {phases.free_speed:>9.5f}"
    if not phases.plucks:
        return f"{row}  no pluck"
    first = phases.plucks[0]
    return (
        f"{row} {first.contact * 1e3:>10.3f} {first.release * 1e3:>10.3f}"
        f" {first.duration * 1e3:>8.3f} {first.peak_force:>7.4f}"
    )


def comparison_summary(comparison: Comparison) -> dict[str, Any]:
    """Return a comparison as JSON would hold it."""

    def plain(departure: Departure) -> dict[str, Any]:
        known = departure.low is not None
        return {
            "value": departure.value,
            "ci95": [departure.low, departure.high] if known else None,
        }

    return {
        "slope_error": plain(comparison.slope_error),
        "magnitude_error": plain(comparison.magnitude_error),
        "duration_error": plain(comparison.duration_error),
    }


def comparison_lines(comparison: Comparison, level: str) -> list[str]:
    """Return a comparison as text; a departure is predicted / measured - 1."""

    def said(departure: Departure) -> str:
        text = f"{departure.value:+.2%}"
        if departure.low is None or departure.high is None:
            return f"{text} (one press: no interval)"
        return f"{text} (95 %: {departure.low:+.2%} to {departure.high:+.2%})"

    return [
        f"model ({level}) against {comparison.presses} presses, predicted / measured - 1:",
        f"  slope of force on deflection  {said(comparison.slope_error)}",
        f"  rise of force to release      {said(comparison.magnitude_error)}",
        f"  time the string is held       {said(comparison.duration_error)}",
    ]
