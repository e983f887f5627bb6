"""The report's tables: features, repeatability and comparison, in readable units."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import AliasChoices, Field, FiniteFloat

from sautereau.analysis.model.choirs import string_names
from sautereau.analysis.press.features import (
    OF_PLUCK,
    Row,
    by_string,
    column,
    gain_stds,
    quantity_of,
    split_column,
    std_of,
    title_of,
)
from sautereau.analysis.report.contents import PressRecord
from sautereau.analysis.results.prediction import Written, read_part
from sautereau.analysis.session.conditions import SessionAnalysis
from sautereau.analysis.text import counted, in_rig_units
from sautereau.rig.disk import table_beside
from sautereau.rig.quantities import QUANTITIES

NONE = "–"
DIGITS = {name: int(decimals) for name, decimals in table_beside(__file__)}
"""Features in the table, in their order, with their decimal places."""
LATER = ("contact", "release", "pluck_duration", "release_force", "force_drop")
"""Features in the table of the second and later strings as well."""
COURSE = ("held_speed_mean", "held_speed_error", "pluck_duration", "release_force")
"""Features that are drawn from press to press."""


def feature_table(found: SessionAnalysis[PressRecord]) -> dict[str, Any]:
    """Return the features of every press, with mean and spread of presses of one condition.

    Returns:
        `heads` of the columns, `rows` with `number`, `mark` (its condition, and whether it is a
        warm-up press) and `cells` of each press, and `feet` with name and cells of mean and
        standard deviation; empty where there are none.
    """
    presses, many = found.presses, len(found.conditions) > 1
    strings = max((string_names(c.rig) for c in found.conditions), key=len)
    features = [by_string(press.features) for press in presses]
    numbers = {p.number: i for i, c in enumerate(found.conditions, 1) for p in c.presses}
    later = range(2, len(strings) + 1)
    columns = [*DIGITS, *(column(name, string) for string in later for name in LATER)]
    if all(len(press.phases.plucks) == 1 for press in presses):
        columns.remove("plucks")
    columns = [name for name in columns if any(_value(f, name) is not None for f in features)]
    rows = []
    for press, own in zip(presses, features, strict=True):
        marks = [f" condition {numbers[press.number]}"] * many
        marks += [" warm-up"] * press.session.warm_up
        cells = [_cell(own, name) for name in columns]
        rows.append({"number": press.number, "mark": ",".join(marks), "cells": cells})
    feet = []
    if not many and len(found.conditions[0].counted) > 1:
        pooled = {one.name: one for one in found.conditions[0].features}
        means, stds = [], []
        for name in columns:
            one, scale = pooled.get(name), quantity_of(name).displayed[0]
            if one is None or one.std is None:
                means, stds = [*means, NONE], [*stds, NONE]
                continue
            means.append(f"{one.measured.value * scale:.{DIGITS[split_column(name)[0]]}f}")
            stds.append(f"{float(f'{one.std * scale:.2g}'):g}")
        feet = [("mean", means), ("standard deviation", stds)]
    return {"heads": [title_of(name, strings) for name in columns], "rows": rows, "feet": feet}


def _value(features: Row, name: str) -> float | None:
    """Return a feature of a press in the displayed unit; None without one."""
    value = features.get(name)
    return value * quantity_of(name).displayed[0] if isinstance(value, int | float) else None


def _cell(features: Row, name: str) -> str:
    """Return the text of a press's cell: the value, and its standard uncertainty if known."""
    value = _value(features, name)
    if value is None:
        return NONE
    feature, pluck = split_column(name)
    std = _value(features, column(f"{feature}_std", pluck))
    text = f"{value:.{DIGITS[feature]}f}"
    return text if std is None else f"{text} ± {std:#.2g}".rstrip(".")


@dataclass(frozen=True)
class Course:
    """A feature from press to press, in the displayed unit; None for a press without it."""

    title: str
    """Of its axis."""
    values: list[float | None]
    stds: list[float | None]
    """Standard uncertainties of one press; None if unknown."""


def courses(presses: Sequence[PressRecord]) -> list[Course]:
    """Return the features in `COURSE` from press to press."""
    found = []
    strings = max((string_names(press.press.rig) for press in presses), key=len)
    features = [by_string(press.features) for press in presses]
    gains = [gain_stds(press.press.rig) for press in presses]
    every = range(1, len(strings) + 1)
    for name in (column(n, k) for n in COURSE for k in (every if n in OF_PLUCK else (1,))):
        scale, _ = quantity_of(name).displayed
        values = [_value(own, name) for own in features]
        stds = [std_of(own, name, gain) for own, gain in zip(features, gains, strict=True)]
        shown = [None if std is None else std * scale for std in stds]
        if any(value is not None for value in values):
            found.append(Course(title_of(name, strings), values, shown))
    return found


PATTERN = "fit*.json"  # Names of their files in the session's folder


VERDICTS = {
    True: "",
    False: "; the model does not fit",
    None: "; whether the model fits is unknown",
}  # Text about a fit by whether the model fits


class _Estimate(Written):
    unit: str
    value: FiniteFloat
    std: FiniteFloat | None
    std_noise: FiniteFloat | None = None
    std_inputs: FiniteFloat | None = None
    ci95: tuple[FiniteFloat, FiniteFloat] | None
    identifiable: bool


class _Identified(Written):
    parameters: dict[str, _Estimate]
    presses: tuple[str, ...]
    level: str
    residual: FiniteFloat = Field(validation_alias=AliasChoices("residual", "rms"))
    residual_before: FiniteFloat = Field(
        validation_alias=AliasChoices("residual_before", "rms_before")
    )
    fits: bool | None = None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Fit:
    """Parameters fitted to presses, as the page shows them."""

    name: str
    """Name of the file."""
    about: str
    rows: tuple[tuple[str, ...], ...]
    """Parameter, value, standard uncertainties from noise and inputs and in total, 95 % interval;
    the parts are `-` in files of earlier versions."""
    warnings: tuple[str, ...] = ()


def read_fit(path: Path) -> Fit:
    """Read a fit.

    Raises:
        AnalysisError: The file cannot be read, or was not written by `identify`.
    """
    how = f"write it with `sautereau identify ... --json > {path.name}`"
    found = read_part(path, _Identified, f"{how}, or give it a name other than {PATTERN}")
    return Fit(
        path.name,
        f"fitted to {counted(len(found.presses), 'press')}, plectrum model {found.level};"
        f" {QUANTITIES['residual'].label}: {found.residual_before * 1e3:.3g} mN before the fit,"
        f" {found.residual * 1e3:.3g} mN after{VERDICTS[found.fits]}",
        tuple(_row(name, estimate) for name, estimate in found.parameters.items()),
        found.warnings,
    )


def _row(name: str, found: _Estimate) -> tuple[str, ...]:
    stds = found.std_noise, found.std_inputs, found.std
    value, (*parts, total), unit = in_rig_units(found.value, found.std, found.unit, stds)
    ends = [in_rig_units(end, found.std, found.unit)[0] for end in found.ci95 or ()]
    note = "" if found.identifiable else ", not identifiable from these recordings"
    return (
        f"{name}{note}",
        f"{value} {unit}".strip(),
        *parts,
        "undetermined" if found.std is None else total,
        " to ".join(ends) or "none",
    )
