"""The repeatability of a session as JSON and as text."""

from dataclasses import fields
from typing import Any

from sautereau.analysis.session.repeatability import Repeatability, Spread, Trend
from sautereau.rig.quantities import QUANTITIES


def repeatability_summary(found: Repeatability) -> dict[str, Any]:
    """Return a session's repeatability as JSON; SI units."""

    def plain(value: Any) -> Any:
        if isinstance(value, Spread):
            return {"value": value.value, "ci95": [value.low, value.high]}
        if isinstance(value, Trend):
            return {"per_press": value.per_press, "ci95": [value.low, value.high]}
        return value

    return {field.name: plain(getattr(found, field.name)) for field in fields(found)}


def repeatability_lines(found: Repeatability) -> list[str]:
    """Return a session's repeatability as text; of the drifts only those that are significant."""
    lines = [f"repeatability over the cruise (ISO 9283), {found.presses} presses:"]
    for name, shown in (
        ("path_repeatability", f"{found.path_repeatability * 1e6:.3g} um"),
        ("path_accuracy", f"{found.path_accuracy * 1e6:.3g} um"),
        ("velocity_accuracy", f"{found.velocity_accuracy:+.3%}"),
        ("velocity_repeatability", _with_interval(found.velocity_repeatability)),
        ("velocity_fluctuation", f"{found.velocity_fluctuation:.3%}"),
    ):
        lines.append(f"  {QUANTITIES[name].label:<32} {shown}")
    rise, speed = found.rise_drift, found.speed_drift
    if rise.significant:
        lines.append(
            f"  {QUANTITIES['rise_drift'].label:<32} {rise.per_press * 1e6:+.3g} um per press"
            f" (95 %: {rise.low * 1e6:+.3g} to {rise.high * 1e6:+.3g})"
        )
    if speed.significant:
        lines.append(
            f"  {QUANTITIES['speed_drift'].label:<32} {speed.per_press:+.3%} per press"
            f" (95 %: {speed.low:+.3%} to {speed.high:+.3%})"
        )
    return lines


def _with_interval(spread: Spread) -> str:
    return f"{spread.value:.3%} (95 %: {spread.low:.3%} to {spread.high:.3%})"
