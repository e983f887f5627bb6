"""The report's tables: features, repeatability and comparison, in readable units."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from sautereau.analysis.report.contents import PressRecord
from sautereau.analysis.session.compare import Comparison, Mean
from sautereau.analysis.session.compare_features import ComparedFeature
from sautereau.analysis.session.repeatability import Repeatability

NONE = "–"


@dataclass(frozen=True)
class Column:
    """One feature as the page shows it."""

    name: str
    """Of the feature."""
    label: str
    unit: str
    scale: float
    """From SI to the unit."""
    digits: int
    """Behind the point."""
    std: str = ""
    """Feature that is its standard uncertainty."""

    @property
    def head(self) -> str:
        """What stands over the column."""
        return f"{self.label} ({self.unit})" if self.unit else self.label

    def value(self, features: Mapping[str, object]) -> float | None:
        """Return the value of a press in the column's unit; None without one."""
        value = features.get(self.name)
        return None if not isinstance(value, int | float) else value * self.scale

    def cell(self, features: Mapping[str, object]) -> str:
        """Return what stands in a press's row."""
        value, std = self.value(features), features.get(self.std)
        if value is None:
            return NONE
        text = f"{value:.{self.digits}f}"
        return f"{text} ± {std * self.scale:.2g}" if isinstance(std, int | float) else text


COLUMNS = (
    Column("plucks", "plucks", "", 1, 0),
    Column("free_speed", "jack speed, free", "m/s", 1, 5),
    Column("contact", "contact", "ms", 1e3, 3, "contact_std"),
    Column("release", "release", "ms", 1e3, 3, "release_std"),
    Column("pluck_duration", "held", "ms", 1e3, 3),
    Column("contact_force", "force at contact", "N", 1, 4),
    Column("release_force", "largest force", "N", 1, 4),
    Column("force_drop", "fall at release", "N", 1, 4),
    Column("force_slope", "slope while held", "N/mm", 1e-3, 4),
    Column("held_work", "work while held", "µJ", 1e6, 1),
    Column("press_work", "work of the press", "µJ", 1e6, 1),
)
LATER = ("contact", "release", "pluck_duration", "force_drop")
"""Features that are shown of every pluck after the first as well."""
COURSE = ("free_speed", "pluck_duration", "release_force")
"""Features that are drawn from press to press."""


@dataclass(frozen=True)
class Row:
    """One press in the table of features."""

    number: int
    mark: str
    """What is particular about it."""
    cells: tuple[str, ...]


@dataclass(frozen=True)
class Foot:
    """What a column's presses say together."""

    name: str
    cells: tuple[str, ...]


@dataclass(frozen=True)
class Table:
    """The features of every press."""

    heads: tuple[str, ...]
    rows: tuple[Row, ...]
    feet: tuple[Foot, ...]


def feature_table(presses: Sequence[PressRecord], conditions: Mapping[int, int]) -> Table:
    """Return the features of every press, with mean and spread where all are alike.

    Args:
        presses: In the order in which they were made.
        conditions: Number of its condition by that of a press.
    """
    many = len(set(conditions.values())) > 1
    columns = [
        column
        for column in _columns(presses)
        if any(column.value(press.features.row()) is not None for press in presses)
    ]
    if all(len(press.phases.plucks) == 1 for press in presses):
        columns = [column for column in columns if column.name != "plucks"]
    rows = []
    for press in presses:
        marks = [f" condition {conditions[press.number]}"] * many
        marks += [" warm-up"] * press.session.warm_up
        rows.append(
            Row(press.number, ",".join(marks), tuple(c.cell(press.features.row()) for c in columns))
        )
    counted = [press for press in presses if not press.session.warm_up]
    feet = ()
    if len(counted) > 1 and not many:
        feet = (
            Foot("mean", tuple(_over(c, counted, spread=False) for c in columns)),
            Foot("standard deviation", tuple(_over(c, counted, spread=True) for c in columns)),
        )
    return Table(tuple(c.head for c in columns), tuple(rows), feet)


def course(presses: Sequence[PressRecord]) -> list[tuple[str, list[float | None]]]:
    """Return axis and values, press by press, of the features that are drawn so."""
    wanted = [column for column in COLUMNS if column.name in COURSE]
    return [(c.head, [c.value(press.features.row()) for press in presses]) for c in wanted]


def _columns(presses: Sequence[PressRecord]) -> list[Column]:
    """Return the columns, with those of the plucks after the first."""
    most = max(len(press.phases.plucks) for press in presses)
    later = [
        replace(
            column,
            name=f"{column.name}_{number}",
            label=f"{column.label}, pluck {number}",
            std=column.std and f"{column.std}_{number}",
        )
        for number in range(2, most + 1)
        for column in COLUMNS
        if column.name in LATER
    ]
    return [*COLUMNS, *later]


def _over(column: Column, presses: Sequence[PressRecord], *, spread: bool) -> str:
    values = [v for p in presses if (v := column.value(p.features.row())) is not None]
    if len(values) < 2 or not column.unit:
        return NONE
    if spread:
        return f"{np.std(values, ddof=1):.2g}"
    return f"{np.mean(values):.{column.digits}f}"


def compared_rows(found: Sequence[ComparedFeature]) -> list[tuple[str, str, str, str, str]]:
    """Return feature, mean, its interval, the model's value and the presses that have it."""
    columns = {column.name: column for column in COLUMNS}
    rows = []
    for one in found:
        name, _, number = one.name.rpartition("_")
        later = number.isdigit()
        column = columns.get(name if later else one.name)
        scale, unit = (column.scale, column.unit) if column else _readable(one.unit)
        label = column.label if column else (name if later else one.name).replace("_", " ")
        interval = "one press: none"
        if one.measured.low is not None and one.measured.high is not None:
            interval = f"{one.measured.low * scale:.5g} to {one.measured.high * scale:.5g}"
        rows.append(
            (
                f"{label}{f', pluck {number}' if later else ''} ({unit})",
                f"{one.measured.value * scale:.5g}",
                interval,
                f"{one.predicted * scale:.5g}",
                str(one.presses),
            )
        )
    return rows


def _readable(unit: str) -> tuple[float, str]:
    return (1e3, "mm") if unit == "m" else (1.0, unit)


def comparison_rows(found: Comparison) -> list[tuple[str, str, str]]:
    """Return quantity, mean departure and interval of everything that was compared."""
    rows = []
    for name in (field.name for field in fields(found)):
        value = getattr(found, name)
        if isinstance(value, Mean):
            label = _QUANTITIES.get(name, name.removesuffix("_error").replace("_", " "))
            known = value.low is not None and value.high is not None
            interval = f"{value.low:+.2%} to {value.high:+.2%}" if known else "one press: none"
            rows.append((label, f"{value.value:+.2%}", interval))
    return rows


_QUANTITIES = {
    "slope_error": "slope of force on deflection",
    "magnitude_error": "rise of force to release",
    "duration_error": "time the string is held",
}


def repeatability_rows(found: Repeatability) -> list[tuple[str, str, str]]:
    """Return figure, value and interval of the norm's figures and of the drifts."""
    spread, rise, speed = found.velocity_repeatability, found.rise_drift, found.speed_drift
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
            f"drift of the rise{'' if rise.significant else ', none told from chance'}",
            f"{rise.per_press * 1e6:+.3g} µm a press",
            f"{rise.low * 1e6:+.3g} to {rise.high * 1e6:+.3g}",
        ),
        (
            f"drift of the speed{'' if speed.significant else ', none told from chance'}",
            f"{speed.per_press:+.3%} a press",
            f"{speed.low:+.3%} to {speed.high:+.3%}",
        ),
    ]
