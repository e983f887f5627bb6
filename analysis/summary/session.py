"""What a session's presses say together, as plain values and as lines."""

from dataclasses import fields
from typing import Any

from sautereau.analysis.session.repeatability import Repeatability, Spread, Trend


def repeatability_summary(found: Repeatability) -> dict[str, Any]:
    """Return a session's repeatability as JSON would hold it; SI units."""

    def plain(value: Any) -> Any:
        if isinstance(value, Spread):
            return {"value": value.value, "ci95": [value.low, value.high]}
        if isinstance(value, Trend):
            return {"per_press": value.per_press, "ci95": [value.low, value.high]}
        return value

    return {name: plain(getattr(found, name)) for name in (field.name for field in fields(found))}


def repeatability_lines(found: Repeatability) -> list[str]:
    """Return a session's repeatability as text."""
    spread, rise, speed = found.velocity_repeatability, found.rise_drift, found.speed_drift
    lines = [
        f"repeatability of {found.presses} presses over the cruise, in the words of ISO 9283:",
        f"  path repeatability RT         {found.path_repeatability * 1e6:.3g} um",
        f"  path accuracy AT              {found.path_accuracy * 1e6:.3g} um",
        f"  path velocity accuracy AV     {found.velocity_accuracy:+.3%}",
        f"  path velocity repeatability RV {spread.value:.3%}"
        f" (95 %: {spread.low:.3%} to {spread.high:.3%})",
        f"  path velocity fluctuation FV  {found.velocity_fluctuation:.3%}",
    ]
    if rise.told:
        lines.append(
            f"  the rise drifts by {rise.per_press * 1e6:+.3g} um a press"
            f" (95 %: {rise.low * 1e6:+.3g} to {rise.high * 1e6:+.3g})"
        )
    if speed.told:
        lines.append(
            f"  the speed drifts by {speed.per_press:+.3%} a press"
            f" (95 %: {speed.low:+.3%} to {speed.high:+.3%})"
        )
    return lines
