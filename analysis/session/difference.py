"""Two sets of presses side by side: the difference of each feature with its interval."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.session.conditions import Condition, SessionAnalysis, differing, label_of
from sautereau.analysis.session.pooled import PooledFeature
from sautereau.analysis.session.repeatability import interval_of


@dataclass(frozen=True)
class Difference:
    """The mean of one feature in a set of presses minus that in another, in its unit."""

    name: str
    unit: str
    first: PooledFeature
    second: PooledFeature
    value: float
    """First minus second."""
    low: float | None
    """Lower end of the 95 % interval; None where a set has a single press."""
    high: float | None
    """Upper end of the 95 % interval."""

    @property
    def significant(self) -> bool:
        """Whether there is an interval, and it excludes zero."""
        return self.low is not None and self.high is not None and not self.low <= 0 <= self.high


@dataclass(frozen=True)
class Pair:
    """A condition of each of two sets, side by side."""

    first: Condition
    second: Condition
    changed: Mapping[str, tuple[Any, Any]]
    """Values in which they differ, by dotted key: of the first and of the second."""
    differences: tuple[Difference, ...]
    label: str = ""
    """Values that both have and others of their sets have not; empty for a single pair."""


def side_by_side(first: SessionAnalysis, second: SessionAnalysis) -> tuple[Pair, ...]:
    """Pair the conditions of two sets of presses, and return their differences.

    Single conditions are a pair. Of several, those are paired that agree in all values that vary
    within a set, except for the day: of two sessions at three speeds each, those of equal speed.

    Raises:
        AnalysisError: A set holds equal conditions of several days, or no two conditions agree.
    """
    if len(first.conditions) == len(second.conditions) == 1:
        return (_pair(first.conditions[0], second.conditions[0]),)
    keys = {key for one in (first, second) for c in one.conditions for key in c.changed} - {"day"}
    those, these = _by_values(first, sorted(keys)), _by_values(second, sorted(keys))
    pairs = tuple(_pair(those[label], these[label], label) for label in those if label in these)
    if not pairs:
        raise AnalysisError(
            "presses of different conditions are not pooled, and no condition is in both sets"
            f" (first: {'; '.join(those)}, second: {'; '.join(these)}); give recordings of one"
            " condition in each set"
        )
    return pairs


def _by_values(one: SessionAnalysis, keys: list[str]) -> dict[str, Condition]:
    """Return the conditions by the values of these keys, as text."""
    found: dict[str, Condition] = {}
    for condition in one.conditions:
        label = label_of(condition, keys) or "all presses"
        if label in found:
            raise AnalysisError(
                f"presses of {found[label].values['day']} and {condition.values['day']} are not"
                f" pooled ({label}); give the recordings of one day in each set"
            )
        found[label] = condition
    return found


def _pair(first: Condition, second: Condition, label: str = "") -> Pair:
    others = {feature.name: feature for feature in second.features}
    keys = differing(first.values, second.values)
    return Pair(
        first,
        second,
        {key: (first.values.get(key), second.values.get(key)) for key in keys},
        tuple(
            difference(feature, others[feature.name])
            for feature in first.features
            if feature.name in others
        ),
        label,
    )


def difference(first: PooledFeature, second: PooledFeature) -> Difference:
    """Return the difference of a feature's means, with Welch's 95 % interval.

    B. L. Welch, Biometrika 34 (1947): the variances of the two sets need not be equal. Errors of
    the fit that all presses of a set may share (`PooledFeature.level_std`) are added to them.
    """
    value, low, high = first.measured.value - second.measured.value, None, None
    if min(first.presses, second.presses) > 1:
        variances = [float(np.var(one.values, ddof=1)) / one.presses for one in (first, second)]
        free = [one.presses - 1 for one in (first, second)]
        scatter = sum(v**2 / n for v, n in zip(variances, free, strict=True))
        freedom = sum(variances) ** 2 / scatter if scatter else min(free)
        shared = np.array([first.level_std, second.level_std])
        (_, low, high), *_ = interval_of(value, sum(variances), shared, freedom)
    return Difference(first.name, first.unit, first, second, value, low, high)
