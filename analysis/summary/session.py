"""The analysis of a session as JSON and as text: comparison, repeatability, drift, differences."""

from dataclasses import fields
from typing import Any

from sautereau.analysis.press.features import split_column, title_of
from sautereau.analysis.session.compare import Mean
from sautereau.analysis.session.conditions import Condition, SessionAnalysis
from sautereau.analysis.session.difference import Difference, Pair
from sautereau.analysis.session.pooled import PooledFeature
from sautereau.analysis.session.repeatability import Repeatability, Spread, Trend
from sautereau.analysis.summary.text import counted, percent, table
from sautereau.rig.quantities import QUANTITIES

INTERVALS = {"student": "Student's t", "bootstrap": "bootstrap of the presses (BCa)"}
SIGNS = {
    "slope_error": ("smaller", "larger"),
    "magnitude_error": ("smaller", "larger"),
    "duration_error": ("shorter", "longer"),
}
"""Words for a model whose error is negative, and for one whose error is positive."""
DRIFTING = ("pluck_duration", "release_force")
"""Features whose drift the text reports: of more, some would be significant by chance."""
NO_INTERVAL = "none (one press)"  # Text in place of the interval of a single press
_OF_SEVERAL = ("presses", "changed", "warnings")
"""Keys of a condition that mean something else of a session."""


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
        "velocity_accuracy": (f"{100 * found.velocity_accuracy:+.3f} %", "", True),
        "velocity_repeatability": (
            f"{100 * spread.value:.3g} %",
            f"{100 * spread.low:.3g} % to {100 * spread.high:.3g} %",
            True,
        ),
        "velocity_fluctuation": (f"{100 * found.velocity_fluctuation:.3g} %", "", True),
        "rise_drift": (
            f"{rise.value * 1e6:+.3g} um per press",
            f"{rise.low * 1e6:+.3g} um to {rise.high * 1e6:+.3g} um",
            rise.significant,
        ),
        "speed_drift": (
            f"{100 * speed.value:+.3g} % per press",
            f"{100 * speed.low:+.3g} % to {100 * speed.high:+.3g} %",
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


def analysis_summary(found: SessionAnalysis) -> dict[str, Any]:
    """Return the analysis of a session as JSON: its conditions, and of a single one its keys."""
    conditions = [condition_summary(condition) for condition in found.conditions]
    single = conditions[0] if len(conditions) == 1 else {}
    own = {key: value for key, value in single.items() if key not in _OF_SEVERAL}
    return own | {"conditions": conditions, "simulated": found.simulated}


def condition_summary(found: Condition) -> dict[str, Any]:
    """Return the presses of one condition as JSON; SI units."""
    result: dict[str, Any] = {
        "recordings": [str(press.press.path) for press in found.presses],
        "presses": len(found.counted),
        "changed": dict(found.changed),
    }
    if found.comparison:
        for name in SIGNS:
            error: Mean = getattr(found.comparison, name)
            result[name] = {"value": error.value, "ci95": _ends(error)}
    if found.features:
        result["interval"] = found.features[0].measured.interval
        result["features"] = {one.name: _feature_summary(one) for one in found.features}
    if found.repeatability:
        result["repeatability"] = repeatability_summary(found.repeatability)
    return result | {"warnings": list(found.warnings)}


def _feature_summary(one: PooledFeature) -> dict[str, Any]:
    return {
        "unit": one.unit,
        "presses": one.presses,
        "measured": one.measured.value,
        "ci95": _ends(one.measured),
        "std": one.std,
        "drift": one.drift and {"per_press": one.drift.value, "ci95": _ends(one.drift)},
        "predicted": one.predicted,
    }


def analysis_lines(found: SessionAnalysis, features: bool = True) -> list[str]:
    """Return the analysis of a session as text.

    Args:
        features: Whether to list the features that the model predicts.
    """
    lines = []
    for condition in found.conditions:
        if len(found.conditions) > 1:
            lines.append(f"{found.label(condition)}:")
        lines += _comparison_lines(condition, found.level, features)
        if condition.repeatability:
            lines += repeatability_lines(condition.repeatability)
        lines += _drift_lines(condition)
        lines += condition.warnings
    return lines


def _comparison_lines(found: Condition, level: str, features: bool) -> list[str]:
    if not found.comparison:
        return []
    errors = [error_cells(name, getattr(found.comparison, name)) for name in SIGNS]
    lines = [
        "Model error, (model - measured) / measured,"
        f" {counted(found.comparison.presses, 'press')}, plectrum model {level}:",
        *table([("feature", "error", "95 % interval", "the model is"), *errors], indent=2),
    ]
    compared = [one for one in found.features if one.predicted is not None]
    if features and compared:
        heads = ("feature", "measured", "95 % of the mean", "model")
        lines += table([heads, *map(feature_cells, compared)], indent=2)
        kind = compared[0].measured.interval
        lines += [f"  95 % intervals: {INTERVALS[kind]}"] if kind in INTERVALS else []
    return lines


def _drift_lines(found: Condition) -> list[str]:
    """Return the features of `DRIFTING` whose drift is significant."""
    return [
        f"  drift of the {title_of(one.name)}: {one.drift.value * scale:+.3g} per press (95 %:"
        f" {one.drift.low * scale:+.3g} to {one.drift.high * scale:+.3g})"
        for one in found.features
        if one.name in DRIFTING and one.drift and one.drift.significant
        for scale in [QUANTITIES[split_column(one.name)[0]].displayed[0]]
    ]


def pair_summary(found: Pair) -> dict[str, Any]:
    """Return two conditions side by side as JSON; SI units."""
    return {
        "first": condition_summary(found.first),
        "second": condition_summary(found.second),
        "changed": {key: list(both) for key, both in found.changed.items()},
        "differences": {
            one.name: {
                "unit": one.unit,
                "first": one.first.measured.value,
                "second": one.second.measured.value,
                "difference": one.value,
                "ci95": _ends(one),
                "significant": one.significant,
            }
            for one in found.differences
        },
    }


def pair_lines(found: Pair) -> list[str]:
    """Return two conditions side by side as text."""
    numbers = [counted(len(one.counted), "press") for one in (found.first, found.second)]
    rows = map(_difference_cells, found.differences)
    changed = "; ".join(f"{key}: {a} and {b}" for key, (a, b) in found.changed.items())
    lines = [
        *([f"{found.label}:"] if found.label else []),
        f"first ({numbers[0]}) minus second ({numbers[1]}); "
        + (f"they differ in {changed}" if changed else "same rig, scene and day"),
        *table([("feature", "first", "second", "difference", "+- 95 %", ""), *rows], indent=2),
    ]
    if all(one.high is not None for one in found.differences):
        return [*lines, "  95 % intervals: Welch's t; * significant: the interval excludes zero"]
    return [*lines, "  no 95 % intervals: at least one set has a single press"]


def _difference_cells(one: Difference) -> tuple[str, ...]:
    """Return a feature, its two means, their difference, the half-width of its interval, a mark."""
    scale, _ = QUANTITIES[split_column(one.name)[0]].displayed
    means = (f"{each.measured.value * scale:.5g}" for each in (one.first, one.second))
    half = "-" if one.high is None else f"{(one.high - one.value) * scale:.3g}"
    mark = "*" if one.significant else ""
    return title_of(one.name), *means, f"{one.value * scale:+.3g}", half, mark


def error_cells(name: str, error: Mean) -> tuple[str, str, str, str]:
    """Return a feature, the model's error, its interval, and the sign of the error in words."""
    sign = SIGNS[name][error.value >= 0]
    ends = _ends(error)
    interval = f"{percent(ends[0])} to {percent(ends[1])}" if ends else NO_INTERVAL
    return QUANTITIES[name].label, percent(error.value), interval, sign


def feature_cells(feature: PooledFeature) -> tuple[str, str, str, str]:
    """Return label, mean, its interval and the model's value as texts."""
    scale, _ = QUANTITIES[split_column(feature.name)[0]].displayed
    ends = _ends(feature.measured)
    interval = f"{ends[0] * scale:.5g} to {ends[1] * scale:.5g}" if ends else NO_INTERVAL
    predicted = "" if feature.predicted is None else f"{feature.predicted * scale:.5g}"
    return title_of(feature.name), f"{feature.measured.value * scale:.5g}", interval, predicted


def _ends(mean: Mean | Spread | Difference) -> list[float] | None:
    """Return the ends of the 95 % interval; None for a single press."""
    return None if mean.low is None or mean.high is None else [mean.low, mean.high]
