"""The repeatability of a session, and its comparison with the model, as JSON and as text."""

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from sautereau.analysis.press.features import split_column, title_of
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
        if not isinstance(value, Spread):
            return value
        key = "per_press" if isinstance(value, Trend) else "value"
        return {key: value.value, "ci95": [value.low, value.high]}

    return {field.name: plain(getattr(found, field.name)) for field in fields(found)}


def repeatability_rows(found: Repeatability) -> list[tuple[str, str, str, bool]]:
    """Return label, value and interval of each figure, and whether a drift is significant."""
    spread, rise, speed = found.velocity_repeatability, found.rise_drift, found.speed_drift
    rows = {
        "path_repeatability": (f"{found.path_repeatability * 1e6:.3g} um", "", True),
        "path_accuracy": (f"{found.path_accuracy * 1e6:.3g} um", "", True),
        "velocity_accuracy": (f"{found.velocity_accuracy:+.3%}", "", True),
        "velocity_repeatability": (
            f"{spread.value:.3%}",
            f"{spread.low:.3%} to {spread.high:.3%}",
            True,
        ),
        "velocity_fluctuation": (f"{found.velocity_fluctuation:.3%}", "", True),
        "rise_drift": (
            f"{rise.value * 1e6:+.3g} um per press",
            f"{rise.low * 1e6:+.3g} to {rise.high * 1e6:+.3g}",
            rise.significant,
        ),
        "speed_drift": (
            f"{speed.value:+.3%} per press",
            f"{speed.low:+.3%} to {speed.high:+.3%}",
            speed.significant,
        ),
    }
    return [(QUANTITIES[name].label, *row) for name, row in rows.items()]


def repeatability_lines(found: Repeatability) -> list[str]:
    """Return a session's repeatability as text; of the drifts only those that are significant."""
    return [
        f"repeatability over the cruise (ISO 9283), {found.presses} presses:",
        *(
            f"  {label:<32} {value}" + (f" (95 %: {interval})" if interval else "")
            for label, value, interval, significant in repeatability_rows(found)
            if significant
        ),
    ]


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
        for label, mean, interval, predicted in map(feature_cells, features):
            between = interval or "one press: none"
            lines.append(f"  {label:<34} {mean:>10}  {between:>20} {predicted:>10}")
        kind = features[0].measured.interval
        lines += [f"  95 % intervals: {INTERVALS[kind]}"] if kind in INTERVALS else []
    return lines


def _error_line(name: str, error: Mean) -> str:
    smaller, larger = SIGNS[name]
    sign = f"model {smaller if error.value < 0 else larger}"
    ends = _ends(error)
    interval = f"95 %: {percent(ends[0])} to {percent(ends[1])}" if ends else "one press"
    return f"  {QUANTITIES[name].label:<30} {percent(error.value)} ({sign}), {interval}"


def feature_cells(feature: ComparedFeature) -> tuple[str, str, str, str]:
    """Return label, mean, its interval (empty for one press) and the model's value as texts."""
    scale, _ = QUANTITIES[split_column(feature.name)[0]].displayed
    ends = _ends(feature.measured)
    interval = f"{ends[0] * scale:.5g} to {ends[1] * scale:.5g}" if ends else ""
    mean, predicted = f"{feature.measured.value * scale:.5g}", f"{feature.predicted * scale:.5g}"
    return title_of(feature.name), mean, interval, predicted


def _ends(mean: Mean) -> list[float] | None:
    """Return the ends of the 95 % interval; None for a single press."""
    return None if mean.low is None or mean.high is None else [mean.low, mean.high]
