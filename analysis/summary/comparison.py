"""Presses beside the model, as plain values and as lines."""

from collections.abc import Sequence
from typing import Any

from sautereau.analysis.session.compare import Comparison, Departure
from sautereau.analysis.session.compare_features import ComparedFeature

INTERVALS = {"student": "Student's t", "bootstrap": "presses resampled, BCa"}
READABLE = {"s": (1e3, "ms"), "m": (1e3, "mm"), "N": (1.0, "N"), "J": (1e6, "uJ")}


def comparison_summary(
    comparison: Comparison, features: Sequence[ComparedFeature] = ()
) -> dict[str, Any]:
    """Return a comparison as JSON would hold it."""

    def plain(departure: Departure) -> dict[str, Any]:
        known = departure.low is not None
        return {
            "value": departure.value,
            "ci95": [departure.low, departure.high] if known else None,
        }

    result: dict[str, Any] = {
        "slope_error": plain(comparison.slope_error),
        "magnitude_error": plain(comparison.magnitude_error),
        "duration_error": plain(comparison.duration_error),
    }
    if features:
        result["interval"] = features[0].interval
        result["features"] = {
            feature.name: {
                "unit": feature.unit,
                "presses": feature.presses,
                "measured": feature.measured,
                "ci95": None if feature.low is None else [feature.low, feature.high],
                "predicted": feature.predicted,
            }
            for feature in features
        }
    return result


def comparison_lines(
    comparison: Comparison, level: str, features: Sequence[ComparedFeature] = ()
) -> list[str]:
    """Return a comparison as text; a departure is predicted / measured - 1."""

    def said(departure: Departure) -> str:
        text = f"{departure.value:+.2%}"
        if departure.low is None or departure.high is None:
            return f"{text} (one press: no interval)"
        return f"{text} (95 %: {departure.low:+.2%} to {departure.high:+.2%})"

    lines = [
        f"model ({level}) against {comparison.presses} presses, predicted / measured - 1:",
        f"  slope of force on deflection  {said(comparison.slope_error)}",
        f"  rise of force to release      {said(comparison.magnitude_error)}",
        f"  time the string is held       {said(comparison.duration_error)}",
    ]
    if features:
        lines.append(
            f"  {'feature':<20} {'measured':>10}  {'95 % of the mean':>22} {'predicted':>10}"
        )
        lines += [_feature_line(feature) for feature in features]
        if features[0].interval in INTERVALS:
            lines.append(f"  intervals by {INTERVALS[features[0].interval]}")
    return lines


def _feature_line(feature: ComparedFeature) -> str:
    scale, unit = READABLE.get(feature.unit, (1.0, feature.unit))
    between = "one press: none"
    if feature.low is not None and feature.high is not None:
        between = f"{feature.low * scale:.5g} to {feature.high * scale:.5g}"
    return (
        f"  {feature.name:<20} {feature.measured * scale:>10.5g}  {between:>22}"
        f" {feature.predicted * scale:>10.5g} {unit}"
    )
