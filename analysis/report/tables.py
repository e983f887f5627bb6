"""The report's tables: features, repeatability and comparison, in readable units."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np

from sautereau.analysis.report.contents import PressRecord
from sautereau.analysis.session.compare import ComparedFeature, Comparison, Mean
from sautereau.analysis.session.repeatability import Repeatability
from sautereau.rig.quantities import QUANTITIES

NONE = "–"
NO_INTERVAL = "none (one press)"
DIGITS = {
    "plucks": 0,
    "free_speed": 5,
    "contact": 3,
    "release": 3,
    "pluck_duration": 3,
    "contact_force": 4,
    "release_force": 4,
    "peak_force": 4,
    "force_drop": 4,
    "force_slope": 4,
    "held_work": 1,
    "press_work": 1,
}
"""Features in the table, in their order, with their decimal places."""
LATER = ("contact", "release", "pluck_duration", "release_force", "force_drop")
"""Features in the table of the second and later plucks as well."""
COURSE = ("free_speed", "pluck_duration", "release_force")
"""Features that are drawn from press to press."""


@dataclass(frozen=True)
class Column:
    """One feature of the table."""

    feature: str
    """Name in `QUANTITIES`."""
    pluck: int = 1

    @property
    def key(self) -> str:
        """Name of the feature in a press's row."""
        return self.feature if self.pluck == 1 else f"{self.feature}_{self.pluck}"

    @property
    def head(self) -> str:
        """Heading of the column, with the unit."""
        quantity = QUANTITIES[self.feature]
        title = quantity.title(quantity.displayed[1].replace("uJ", "µJ"))
        return title if self.pluck == 1 else f"{title}, pluck {self.pluck}"

    def value(self, features: Mapping[str, object]) -> float | None:
        """Return the value of a press in the displayed unit; None without one."""
        value = features.get(self.key)
        return value * self._scale if isinstance(value, int | float) else None

    def cell(self, features: Mapping[str, object]) -> str:
        """Return the text of a press's cell: the value, and its standard uncertainty if known."""
        value = self.value(features)
        if value is None:
            return NONE
        std = features.get(self.key.replace(self.feature, f"{self.feature}_std"))
        uncertainty = f" ± {std * self._scale:.2g}" if isinstance(std, int | float) else ""
        return f"{value:.{DIGITS[self.feature]}f}{uncertainty}"

    def statistics(self, presses: Sequence[PressRecord]) -> tuple[str, str]:
        """Return mean and standard deviation over presses."""
        values = [v for p in presses if (v := self.value(p.features.row())) is not None]
        if len(values) < 2 or self.feature == "plucks":
            return NONE, NONE
        spread = float(f"{np.std(values, ddof=1):.2g}")
        return f"{np.mean(values):.{DIGITS[self.feature]}f}", f"{spread:g}"

    @property
    def _scale(self) -> float:
        return QUANTITIES[self.feature].displayed[0]


@dataclass(frozen=True)
class Row:
    """One press in the table of features."""

    number: int
    mark: str
    """Its condition, and whether it is a warm-up press."""
    cells: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """The features of every press."""

    heads: tuple[str, ...]
    rows: tuple[Row, ...]
    feet: tuple[tuple[str, tuple[str, ...]], ...]
    """Name and cells of mean and standard deviation; empty where there are none."""


def feature_table(presses: Sequence[PressRecord], conditions: Mapping[int, int]) -> Table:
    """Return the features of every press, with mean and spread of presses of one condition.

    Args:
        presses: In the order in which they were made.
        conditions: Number of the condition by number of the press.
    """
    many = len(set(conditions.values())) > 1
    most = max(len(press.phases.plucks) for press in presses)
    columns = [Column(feature) for feature in DIGITS]
    columns += [Column(feature, pluck) for pluck in range(2, most + 1) for feature in LATER]
    columns = [
        column
        for column in columns
        if any(column.value(press.features.row()) is not None for press in presses)
    ]
    if all(len(press.phases.plucks) == 1 for press in presses):
        columns = [column for column in columns if column.feature != "plucks"]
    rows = []
    for press in presses:
        marks = [f" condition {conditions[press.number]}"] * many
        marks += [" warm-up"] * press.session.warm_up
        cells = tuple(column.cell(press.features.row()) for column in columns)
        rows.append(Row(press.number, ",".join(marks), cells))
    counted = [press for press in presses if not press.session.warm_up]
    feet = ()
    if len(counted) > 1 and not many:
        cells = zip(*(column.statistics(counted) for column in columns), strict=True)
        feet = tuple(zip(("mean", "standard deviation"), cells, strict=True))
    return Table(tuple(column.head for column in columns), tuple(rows), feet)


def course(presses: Sequence[PressRecord]) -> list[tuple[str, list[float | None]]]:
    """Return the axis title and the values, press by press, of the features in `COURSE`."""
    columns = [Column(feature) for feature in COURSE]
    return [(c.head, [c.value(press.features.row()) for press in presses]) for c in columns]


def compared_rows(found: Sequence[ComparedFeature]) -> list[tuple[str, str, str, str, str]]:
    """Return feature, mean, its interval, the model's value and the number of presses."""
    rows = []
    for one in found:
        name, _, number = one.name.rpartition("_")
        column = Column(name, int(number)) if number.isdigit() else Column(one.name)
        scale, _ = QUANTITIES[column.feature].displayed
        interval = _interval(one.measured, lambda value, scale=scale: f"{value * scale:.5g}")
        mean, predicted = f"{one.measured.value * scale:.5g}", f"{one.predicted * scale:.5g}"
        rows.append((column.head, mean, interval, predicted, str(one.presses)))
    return rows


def comparison_rows(found: Comparison) -> list[tuple[str, str, str]]:
    """Return quantity, mean model error and its interval."""
    errors = {f.name: getattr(found, f.name) for f in fields(found) if f.name in QUANTITIES}
    return [
        (QUANTITIES[name].label, f"{error.value:+.2%}", _interval(error, "{:+.2%}".format))
        for name, error in errors.items()
        if isinstance(error, Mean)
    ]


def _interval(mean: Mean, text: Callable[[float], str]) -> str:
    if mean.low is None or mean.high is None:
        return NO_INTERVAL
    return f"{text(mean.low)} to {text(mean.high)}"


def repeatability_rows(found: Repeatability) -> list[tuple[str, str, str]]:
    """Return quantity, value and interval of the figures of ISO 9283 and of the drifts."""
    spread, rise, speed = found.velocity_repeatability, found.rise_drift, found.speed_drift
    chance = ", not significant"
    return [
        ("path repeatability RT", f"{found.path_repeatability * 1e6:.3g} µm", ""),
        ("path accuracy AT", f"{found.path_accuracy * 1e6:.3g} µm", ""),
        ("path velocity accuracy AV", f"{found.velocity_accuracy:+.3%}", ""),
        (
            "path velocity repeatability RV",
            f"{spread.value:.3%}",
            f"{spread.low:.3%} to {spread.high:.3%}",
        ),
        ("path velocity fluctuation FV", f"{found.velocity_fluctuation:.3%}", ""),
        (
            f"drift of the jack rise{'' if rise.significant else chance}",
            f"{rise.per_press * 1e6:+.3g} µm per press",
            f"{rise.low * 1e6:+.3g} to {rise.high * 1e6:+.3g}",
        ),
        (
            f"drift of the jack speed{'' if speed.significant else chance}",
            f"{speed.per_press:+.3%} per press",
            f"{speed.low:+.3%} to {speed.high:+.3%}",
        ),
    ]
