"""The features of presses that may be pooled: mean, spread and drift, beside the model's."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.press.features import (
    OF_PLUCK,
    UNITS,
    Row,
    by_string,
    column,
    level_std,
    split_column,
    std_of,
)
from sautereau.analysis.session.compare import Mean, mean_of, with_shared
from sautereau.analysis.session.repeatability import CHANCE, LEAST, Step, Trend, step_of, trend_of

POOLED = tuple(
    name
    for name, unit in UNITS.items()
    if unit not in ("", "1") and not name.endswith("_std") and name != "rest_force"
)
"""Features of which a mean over presses has a meaning: not the zero of an amplifier."""
DRIFTING = ("pluck_duration", "release_force", "contact_rise")
"""Features of a pluck of which a drift and a step are reported: of more, some change by chance."""


@dataclass(frozen=True)
class PooledFeature:
    """One feature over repeated presses, in its unit."""

    name: str
    """Column of `sautereau.analysis.press.features.by_string`."""
    unit: str
    values: tuple[float, ...]
    """Values of the presses that have it, in the order in which they were made."""
    measured: Mean
    shared_std: float
    """Standard uncertainty of a single press by its sensors and its fit, in its unit."""
    level_std: float
    """The part of it that does not cancel in a difference between conditions."""
    std: float | None
    """Standard deviation of the presses; None for a single one."""
    drift: Trend | None
    """Change per press; None for fewer than three."""
    predicted: float | None
    """The model's mean over the same presses; None for what is not compared."""

    @property
    def step(self) -> Step | None:
        """The change between two presses of one in `DRIFTING`; None where there is none."""
        if split_column(self.name)[0] not in DRIFTING:
            return None
        return step_of(np.array(self.values))

    @property
    def drifts(self) -> bool:
        """Whether one in `DRIFTING` has a drift, and not a step."""
        drifting = split_column(self.name)[0] in DRIFTING
        return bool(drifting and self.drift and self.drift.significant and not self.step)

    @property
    def scatters(self) -> bool:
        """Whether the rise at contact differs by more than the `shared_std` of each press.

        The speed of the jack does not change it, and a force drop has outliers.
        """
        from scipy.special import chdtrc

        is_rise = split_column(self.name)[0] == "contact_rise"
        if not (is_rise and self.std and self.shared_std):
            return False
        free = self.presses - 1
        return bool(chdtrc(free, free * (self.std / self.shared_std) ** 2) < CHANCE)

    @property
    def presses(self) -> int:
        """Number of presses that have it."""
        return len(self.values)


def pooled_features(
    rows: Sequence[Row], predicted: Mapping[str, float], gains: Mapping[str, float]
) -> tuple[PooledFeature, ...]:
    """Return the features of repeated presses, those of plucks by their strings.

    The intervals of the means contain the uncertainty of a single press by its sensors and its fit,
    which further presses do not reduce.

    Args:
        rows: Of `sautereau.analysis.press.features`.
        predicted: The model's, of `sautereau.analysis.session.compare.predicted_means`.
        gains: Relative standard uncertainties of features, of `gain_stds`.
    """
    rows = [by_string(row) for row in rows]
    most = max((split_column(name)[1] for row in rows for name in row), default=1)
    later = [column(name, k) for k in range(2, most + 1) for name in OF_PLUCK if name in POOLED]
    found = []
    for name in (*POOLED, *later):
        values = tuple(value for row in rows if isinstance(value := row.get(name), float))
        if values:
            known = [own for row in rows if (own := std_of(row, name, gains)) is not None]
            shared = float(np.mean(known)) if known else 0.0
            mean = with_shared(mean_of(values), shared)
            unit = UNITS[split_column(name)[0]]
            std = float(np.std(values, ddof=1)) if len(values) > 1 else None
            drift = trend_of(np.array(values)) if len(values) >= LEAST else None
            model = predicted.get(name)
            own = float(
                np.mean([level_std(row, name) for row in rows if row.get(name) is not None])
            )
            found.append(PooledFeature(name, unit, values, mean, shared, own, std, drift, model))
    return tuple(found)
