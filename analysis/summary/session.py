"""The repeatability of a session, and its comparison with the model, as JSON and as text."""

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from sautereau.analysis.press.features import split_column
from sautereau.analysis.session.compare import ComparedFeature, Comparison, Mean
from sautereau.analysis.session.repeatability import Repeatability, Spread, Trend
from sautereau.analysis.summary.text import counted, percent
from sautereau.rig.quantities import QUANTITIES

INTERVALS = {"student": "Student's t", "bootstrap": "bootstrap of the presses (BCa)"}
SIGNS = {
    "slope_error": ("smaller", "larger"),
    "magnitude_error": ("smaller", "larger"),
    "duration_error": ("shorter", "longer"),
}
"""Of the model where its error is negative, and where it is positive."""


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


def comparison_summary(
    comparison: Comparison, features: Sequence[ComparedFeature] = ()
) -> dict[str, Any]:
    """Return a comparison as JSON."""
    result: dict[str, Any] = {}
    for name in SIGNS:
        error: Mean = getattr(comparison, name)
        result[name] = {"value": error.value, "ci95": _ends(error)}
    if features:
        result["interval"] = features[0].measured.interval
        result["features"] = {
            feature.name: {
                "unit": feature.unit,
                "presses": feature.presses,
                "measured": feature.measured.value,
                "ci95": _ends(feature.measured),
                "predicted": feature.predicted,
            }
            for feature in features
        }
    return result


def comparison_lines(
    comparison: Comparison, level: str, features: Sequence[ComparedFeature] = ()
) -> list[str]:
    """Return a comparison as text.

    Args:
        comparison: Of the presses.
        level: Of the plectrum.
        features: Each beside the model's; empty to list none.
    """
    lines = [
        "Model error, (model - measured) / measured,"
        f" {counted(comparison.presses, 'press')}, plectrum model {level}:",
        *(_error_line(name, getattr(comparison, name)) for name in SIGNS),
    ]
    if features:
        lines.append(f"  {'feature':<34} {'measured':>10}  {'95 % of the mean':>20} {'model':>10}")
        lines += [_feature_line(feature) for feature in features]
        kind = features[0].measured.interval
        lines += [f"  95 % intervals: {INTERVALS[kind]}"] if kind in INTERVALS else []
    return lines


def _error_line(name: str, error: Mean) -> str:
    smaller, larger = SIGNS[name]
    sign = f"model {smaller if error.value < 0 else larger}"
    ends = _ends(error)
    interval = f"95 %: {percent(ends[0])} to {percent(ends[1])}" if ends else "one press"
    return f"  {QUANTITIES[name].label:<30} {percent(error.value)} ({sign}), {interval}"


def _feature_line(feature: ComparedFeature) -> str:
    name, pluck = split_column(feature.name)
    scale, unit = QUANTITIES[name].displayed
    label = QUANTITIES[name].title(unit) + (f", pluck {pluck}" if pluck > 1 else "")
    ends = _ends(feature.measured)
    between = f"{ends[0] * scale:.5g} to {ends[1] * scale:.5g}" if ends else "one press: none"
    return (
        f"  {label:<34} {feature.measured.value * scale:>10.5g}  {between:>20}"
        f" {feature.predicted * scale:>10.5g}"
    )


def _ends(mean: Mean) -> list[float] | None:
    """Return the ends of the 95 % interval; None for a single press."""
    return None if mean.low is None or mean.high is None else [mean.low, mean.high]
