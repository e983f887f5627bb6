"""The analysis of a session: comparison, repeatability, drift, differences from another session."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from sautereau.analysis.model.choirs import string_names
from sautereau.analysis.press.features import quantity_of, title_of
from sautereau.analysis.results.result import Result, frame_of, json_of, plain, shown
from sautereau.analysis.session.compare import ERRORS, Mean, listed_contributions
from sautereau.analysis.session.compare import Comparison as Compared
from sautereau.analysis.session.conditions import Condition, SessionAnalysis, shown_of
from sautereau.analysis.session.difference import Difference, Pair
from sautereau.analysis.session.pooled import PooledFeature
from sautereau.analysis.session.repeatability import Repeatability, Spread, Trend
from sautereau.analysis.text import (
    OF_DIFFERENCES,
    counted,
    percent,
    quantity_in_rig,
    remark_lines,
    table,
)
from sautereau.rig.faults import unit_of
from sautereau.rig.quantities import QUANTITIES
from sautereau.rig.schema import Rig

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

INTERVALS = {"student": "Student's t", "bootstrap": "bootstrap of the presses (BCa)"}
CONSISTENT = "consistent with the stated ranges"
UNEXPLAINED = "not explained by the stated ranges"
NO_INTERVAL = "none (one press)"  # Text in place of the interval of a single press
_INDEX = ["condition", "name"]  # Of the tables
_OF_SEVERAL = ("presses", "changed", "warnings")  # Of a session they mean something else


@dataclass(frozen=True, repr=False)
class Comparison(Result):
    """Presses by condition, compared with the model and with another set."""

    found: SessionAnalysis
    pairs: tuple[Pair, ...] = ()
    """Conditions of this set and of the other; empty without another set."""

    def __repr__(self) -> str:
        conditions = counted(len(self.found.conditions), "condition")
        others = [press for pair in self.pairs for press in pair.second.presses]
        against = f" against {counted(len(others), 'press')}" * bool(others)
        return f"<Comparison of {counted(len(self.found.presses), 'press')}{against}, {conditions}>"

    def lines(self, features: bool = True, remarks: bool = True) -> list[str]:
        """Return the comparison as text.

        Args:
            features: Whether to list the features that the model predicts.
            remarks: Whether to list the remarks on presses, instead of their number.
        """
        found, lines = self.found, []
        for condition in found.conditions:
            if len(found.conditions) > 1:
                lines.append(f"{found.label(condition)}:")
            lines += _comparison_lines(condition, features)
            if condition.repeatability:
                lines += repeatability_lines(condition.repeatability)
            lines += [condition.speed_verdict] if condition.speed_reached else []
            lines += condition.warnings
        said = ((p.press.path, text) for p in found.presses for text in p.remarks)
        lines += remark_lines(said, remarks, "`sautereau phases --verbose`")
        return [*lines, *(line for pair in self.pairs for line in pair_lines(pair))]

    @property
    def document(self) -> dict[str, Any]:
        """The conditions as JSON, and of a single one its keys; SI units."""
        conditions = [_condition_document(condition) for condition in self.found.conditions]
        single = conditions[0] if len(conditions) == 1 else {}
        own = {key: value for key, value in single.items() if key not in _OF_SEVERAL}
        against = {"against": [_pair_document(pair) for pair in self.pairs]} if self.pairs else {}
        return own | {"conditions": conditions, "simulated": self.found.simulated} | against

    @property
    def errors(self) -> "pd.DataFrame":
        """Model errors, (model - measured) / measured, with 95 % intervals: with the ranges of the
        model's inputs, and of the measurement alone."""
        rows = [
            (number, name, error.value, *(compared.interval(name) or (None, None)), error.low,
             error.high)
            for number, condition in enumerate(self.found.conditions, 1)
            for compared in ([condition.comparison] if condition.comparison else ())
            for name in ERRORS
            for error in [getattr(compared, name)]
        ]  # fmt: skip
        names = ("value", "low", "high", "low_measured", "high_measured")
        return frame_of(rows, (*_INDEX, *names), _INDEX)

    @property
    def contributions(self) -> "pd.DataFrame":
        """What each input explains of the model errors: fractions of their variances."""
        rows = [
            (number, one.name, one.std, *(one.fractions[name] for name in ERRORS))
            for number, condition in enumerate(self.found.conditions, 1)
            if condition.comparison and condition.comparison.budget
            for one in condition.comparison.budget.contributions
        ]
        return frame_of(rows, (*_INDEX, "std", *ERRORS), _INDEX)

    @property
    def features(self) -> "pd.DataFrame":
        """Features with mean, 95 % interval, standard deviation, drift per press and the model."""
        rows = [
            (number, one.name, one.measured.value, one.measured.low, one.measured.high, one.std,
             one.drift and one.drift.value, one.predicted, one.presses)
            for number, condition in enumerate(self.found.conditions, 1)
            for one in condition.features
        ]  # fmt: skip
        names = ("mean", "low", "high", "std", "drift", "predicted", "presses")
        units = {one.name: one.unit for c in self.found.conditions for one in c.features}
        return frame_of(rows, (*_INDEX, *names), _INDEX, units)

    @property
    def differences(self) -> "pd.DataFrame":
        """Features of this set minus those of the other, with 95 % intervals."""
        rows = [
            (number, one.name, one.first.measured.value, one.second.measured.value, one.value,
             one.low, one.high, one.significant)
            for number, pair in enumerate(self.pairs, 1)
            for one in pair.differences
        ]  # fmt: skip
        names = ("first", "second", "difference", "low", "high", "significant")
        return frame_of(rows, (*_INDEX, *names), _INDEX)

    @property
    def conditions(self) -> "pd.DataFrame":
        """The conditions: number of presses, and the values that vary between them."""
        rows = [
            (number, len(condition.counted), self.found.label(condition))
            for number, condition in enumerate(self.found.conditions, 1)
        ]
        return frame_of(rows, ("condition", "presses", "values"), "condition")

    def to_frame(self) -> "pd.DataFrame":
        """Return the differences from the other set; without one, the features."""
        return self.differences if self.pairs else self.features

    def plot(self, condition: int | None = None) -> "Figure":
        """Return a figure of the first presses of each condition, or of one, and of the model.

        More than three conditions are drawn over each other, with the model errors of each.
        """
        from sautereau.analysis.figures.comparison import session_figure

        return shown(session_figure(self.found, self.pairs, condition))


def repeatability_rows(found: Repeatability) -> list[tuple[str, str, str, bool]]:
    """Return label, value and interval of each figure, and whether a drift is significant."""
    spread, rise, speed = found.velocity_repeatability, found.rise_drift, found.speed_drift
    rows = {
        "path_repeatability": (f"{found.path_repeatability * 1e6:.3g} µm", "", True),
        "path_accuracy": (f"{found.path_accuracy * 1e6:.3g} µm", "", True),
        "velocity_accuracy": (f"{100 * found.velocity_accuracy:+.3f} %", "", True),
        "velocity_repeatability": (
            f"{100 * spread.value:.3g} %",
            f"{100 * spread.low:.3g} % to {100 * spread.high:.3g} %",
            True,
        ),
        "velocity_fluctuation": (f"{100 * found.velocity_fluctuation:.3g} %", "", True),
        "rise_drift": (
            f"{rise.value * 1e6:+.3g} µm per press",
            f"{rise.low * 1e6:+.3g} µm to {rise.high * 1e6:+.3g} µm",
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


def _condition_document(found: Condition) -> dict[str, Any]:
    result: dict[str, Any] = {
        "recordings": [str(press.press.path) for press in found.presses],
        "presses": len(found.counted),
        "changed": dict(found.changed),
    }
    if (compared := found.comparison) is not None:
        result["string"] = compared.string
        for name in ERRORS:
            measured = json_of(getattr(compared, name), "interval")
            ends = compared.interval(name)
            result[name] = measured | {"ci95": ends, "ci95_measured": measured["ci95"]}
        result["verdict"] = CONSISTENT if compared.consistent else UNEXPLAINED
        result["unlike_rig"] = list(compared.unlike_rig)
        result["budget"] = plain(compared.budget.contributions if compared.budget else ())
    if found.features:
        result["interval"] = found.features[0].measured.interval
        result["features"] = {
            one.name: {
                "unit": one.unit,
                "presses": one.presses,
                "measured": one.measured.value,
                "ci95": _ends(one.measured),
                "std": one.std,
                "drift": one.drift and _per_press(one.drift),
                "predicted": one.predicted,
            }
            for one in found.features
        }
    if found.repeatability:
        figures = {f.name: getattr(found.repeatability, f.name) for f in fields(Repeatability)}
        drifts = {name: _per_press(v) for name, v in figures.items() if isinstance(v, Trend)}
        spreads = {name: json_of(v) for name, v in figures.items() if isinstance(v, Spread)}
        result["repeatability"] = figures | spreads | drifts
    if found.speed_reached is not None:
        result["held_speed"] = {
            "min": min(found.of_speed("held_speed_min")),
            "max": max(found.of_speed("held_speed_max")),
            "rms_error": max(found.of_speed("held_speed_error")),
            "tolerance": found.rig.press.speed_tolerance,
            "reached": found.speed_reached,
        }
    return result | {"warnings": list(found.warnings)}


def _per_press(drift: Trend) -> dict[str, Any]:
    return {"per_press": drift.value, "ci95": _ends(drift)}


def _pair_document(found: Pair) -> dict[str, Any]:
    return {
        "first": _condition_document(found.first),
        "second": _condition_document(found.second),
        "changed": {key: list(both) for key, both in found.changed.items()},
        "differences": {
            one.name: {
                "unit": one.unit,
                "first": one.first.measured.value,
                "second": one.second.measured.value,
                "difference": one.value,
                "ci95": _ends(one),
                "level_std": math.hypot(one.first.level_std, one.second.level_std),
                "significant": one.significant,
            }
            for one in found.differences
        },
    }


def _comparison_lines(found: Condition, features: bool) -> list[str]:
    if not (found.comparison and found.prediction):
        return []
    errors = [error_cells(found.comparison, name) for name in ERRORS]
    heads = ("feature", "error", "95 % interval", "measured only")
    strings = string_names(found.rig)
    lines = [
        "Model error, (model - measured) / measured,"
        f" {compared_presses(found.rig, found.comparison)}, plectrum model"
        f" {found.prediction.level}:",
        *table([heads, *errors], indent=2),
        verdict_line(found.comparison),
        *(table(contribution_rows(found.comparison), indent=2) if features else []),
    ]
    compared = [one for one in found.features if one.predicted is not None]
    if features and compared:
        heads = ("feature", "measured", "95 % of the mean", "model")
        lines += table([heads, *(feature_cells(one, strings) for one in compared)], indent=2)
        kind = compared[0].measured.interval
        if kind in INTERVALS:
            lines.append(f"  95 % intervals: {INTERVALS[kind]}, sensors and fit")
    return lines


def pair_lines(found: Pair) -> list[str]:
    """Return two conditions side by side as text."""
    numbers = [counted(len(one.counted), "press") for one in (found.first, found.second)]
    strings = string_names(found.first.rig)
    rows = (_difference_cells(one, strings) for one in found.differences)
    both = {
        key: [shown_of(one, key) for one in (found.first, found.second)] for key in found.changed
    }
    changed = "; ".join(f"{key}: {a} and {b}" for key, (a, b) in both.items())
    lines = [
        *([f"{found.label}:"] if found.label else []),
        f"first ({numbers[0]}) minus second ({numbers[1]}); "
        + (f"they differ in {changed}" if changed else "same rig, scene and day"),
        *table([("feature", "first", "second", "difference", "+- 95 %", ""), *rows], indent=2),
    ]
    if all(one.high is not None for one in found.differences):
        return [*lines, f"  {OF_DIFFERENCES}", "  * significant: the interval excludes zero"]
    return [*lines, "  no 95 % intervals: at least one set has a single press"]


def _difference_cells(one: Difference, strings: Sequence[str]) -> tuple[str, ...]:
    """Return a feature, its two means, their difference, the half-width of its interval, a mark."""
    scale, _ = quantity_of(one.name).displayed
    means = (f"{each.measured.value * scale:.5g}" for each in (one.first, one.second))
    half = "-" if one.high is None else f"{(one.high - one.value) * scale:.3g}"
    mark = "*" if one.significant else ""
    return title_of(one.name, strings), *means, f"{one.value * scale:+.3g}", half, mark


def compared_presses(rig: Rig, found: Compared) -> str:
    """Return which string was compared in how many presses: `string 1, 3 presses`."""
    strings, presses = string_names(rig), counted(found.presses, "press")
    return f"{strings[found.string - 1]}, {presses}" if len(strings) > 1 else presses


def error_cells(found: Compared, name: str) -> tuple[str, ...]:
    """Return a feature, the model's error, its interval with the model's inputs and that of the
    measurement alone."""
    error: Mean = getattr(found, name)
    intervals = (
        f"{percent(ends[0]).removesuffix(' %')} to {percent(ends[1])}" if ends else NO_INTERVAL
        for ends in (found.interval(name), _ends(error))
    )
    return QUANTITIES[name].label, percent(error.value), *intervals


def verdict_line(found: Compared) -> str:
    """Return whether the ranges that the rig states explain the errors, as text."""
    if found.consistent:
        return f"{CONSISTENT}: the intervals contain 0"
    errors = ", ".join(QUANTITIES[name].label for name in found.unexplained)
    return f"{UNEXPLAINED}: {'; '.join([*([errors] if errors else []), *found.unlike_rig])}"


def contribution_rows(found: Compared) -> list[tuple[str, ...]]:
    """Return heads and rows of what each input explains; none without ranges."""
    shown = listed_contributions(found)
    if not shown:
        return []
    heads = ("part of the variance (%)", "uncertainty", "slope", "rise", "duration")
    return [heads] + [
        (
            c.name,
            ""
            if c.std is None
            else quantity_in_rig(c.std, unit_of(Rig, c.name.split(".")) or "", 2),
            *(f"{100 * c.fractions[name]:.0f}" for name in ERRORS),
        )
        for c in shown
    ]


def feature_cells(feature: PooledFeature, strings: Sequence[str]) -> tuple[str, str, str, str]:
    """Return label, mean, its interval and the model's value as texts.

    Args:
        strings: Names of the rig's strings.
    """
    scale, _ = quantity_of(feature.name).displayed
    ends = _ends(feature.measured)
    interval = f"{ends[0] * scale:.5g} to {ends[1] * scale:.5g}" if ends else NO_INTERVAL
    predicted = "" if feature.predicted is None else f"{feature.predicted * scale:.5g}"
    return (
        title_of(feature.name, strings),
        f"{feature.measured.value * scale:.5g}",
        interval,
        predicted,
    )


def _ends(mean: Mean | Spread | Difference) -> list[float] | None:
    """Return the ends of the 95 % interval; None for a single press."""
    return None if mean.low is None or mean.high is None else [mean.low, mean.high]
