"""The press that a fit predicts: its distribution, through the model of the pluck."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, FiniteFloat, ValidationError

from sautereau.analysis.errors import AnalysisError, ModelError
from sautereau.analysis.identify.distribution import Distribution
from sautereau.analysis.identify.parameter_names import ENDS, split_name
from sautereau.analysis.identify.parameters import with_parameters
from sautereau.analysis.model.predict import Prediction, predict
from sautereau.analysis.results.result import Result, frame_of, json_of, shown
from sautereau.analysis.session.compare import pluck_features
from sautereau.analysis.text import counted, table
from sautereau.rig.disk import read_limited, why_unreadable
from sautereau.rig.errors import RigError
from sautereau.rig.faults import first_fault
from sautereau.rig.quantities import QUANTITIES
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

DRAWS = 256  # Of the fit's distribution: the ends of an interval are within 5 % of its width
LEAST = 0.9  # Fraction of the draws that must have a pluck, so that the interval is one of plucks
NAMES = ("release_force", "force_drop", "work", "pluck_duration", "peak_force", "v_osc")
"""Quantities of the press."""


@dataclass(frozen=True)
class Interval:
    """A predicted quantity; SI."""

    name: str
    unit: str
    value: float
    """With the fitted values."""
    std: float
    low: float
    """Lower end of the 95 % interval."""
    high: float
    """Upper end of the 95 % interval."""


@dataclass(frozen=True, repr=False)
class Predicted(Result):
    """Quantities of a press with the intervals that the fitted values' uncertainties cause."""

    rig: Rig
    """With the fitted values."""
    level: str
    intervals: tuple[Interval, ...]
    draws: Floats
    """SI, values of `NAMES` of each draw with a pluck; shape (draws, quantities)."""

    def __repr__(self) -> str:
        force = self.intervals[0]
        return f"<Predicted for rig {self.rig.name}: {_cells(force)[1]} N at release>"

    @property
    def document(self) -> dict[str, Any]:
        """The quantities as JSON; SI units."""
        return {
            "level": self.level,
            "draws": len(self.draws),
            "quantities": {i.name: json_of(i, "name") for i in self.intervals},
        }

    def lines(self) -> list[str]:
        """Return the prediction as text."""
        heads = ("", "value", "std", "95 % interval", "unit")
        return [
            f"rig {self.rig.name} with the fitted values, plectrum model {self.level}; intervals"
            f" from {counted(len(self.draws), 'draw')} of the fit's distribution:",
            *table([heads, *map(_cells, self.intervals)], left=(0, 4), indent=2),
        ]

    def to_frame(self) -> "pd.DataFrame":
        """Return each quantity with its unit, standard uncertainty and 95 % interval."""
        columns = list(Interval.__dataclass_fields__)
        return frame_of([[getattr(i, c) for c in columns] for i in self.intervals], columns, "name")

    def plot(self) -> "Figure":
        """Return a figure of the distribution of each quantity."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(12, 6), layout="constrained")
        panels = figure.subplots(2, 3).ravel()
        for axes, own, draws in zip(panels, self.intervals, self.draws.T, strict=True):
            scale, unit = QUANTITIES[own.name].displayed
            axes.hist(draws * scale, bins=24)
            axes.axvline(own.value * scale, color="black")
            axes.set(xlabel=QUANTITIES[own.name].title(unit), ylabel="draws")
        return shown(figure)


def _cells(own: Interval) -> tuple[str, ...]:
    scale, unit = QUANTITIES[own.name].displayed
    value, std, low, high = (f"{x * scale:.4g}" for x in (own.value, own.std, own.low, own.high))
    return QUANTITIES[own.name].label, value, std, f"{low} to {high}", unit


def predicted(
    rig: Rig, fitted: Distribution, undetermined: Sequence[str] = (), level: str = "auto"
) -> Predicted:
    """Return the press that a fit predicts for a rig.

    Args:
        rig: All other values are those of this rig.
        undetermined: Names of values that the fit could not determine.

    Raises:
        AnalysisError: There are such values, or less than nine of ten draws have a pluck.
        ModelError: The model has no solution for the fitted values.
    """
    if undetermined:
        raise AnalysisError(
            f"predict: the fit leaves {', '.join(undetermined)} undetermined, so that the press has"
            " no interval; give a prior, or free fewer parameters"
        )

    def press(values: Floats) -> tuple[Rig, Prediction]:
        named = dict(zip(fitted.names, values.tolist(), strict=True))
        moved = with_parameters(rig, named)
        return moved, predict(moved, level)

    made, best = press(fitted.values)
    rows = []
    for draw in fitted.drawn(DRAWS):
        try:
            rows.append(_quantities(*press(draw)))
        except (ModelError, RigError):
            continue
    if len(rows) < LEAST * DRAWS:
        raise AnalysisError(
            f"predict: {len(rows)} of {DRAWS} draws of the fit's distribution have a pluck, and"
            f" {LEAST * DRAWS:.0f} are needed: the values are too uncertain; record more presses,"
            " or give priors"
        )
    draws = np.array(rows)
    lows, highs = np.quantile(draws, (0.025, 0.975), axis=0)
    stds = draws.std(axis=0, ddof=1)
    table_of = zip(NAMES, _quantities(made, best), stds, lows, highs, strict=True)
    return Predicted(
        made,
        best.level,
        tuple(Interval(n, QUANTITIES[n].unit, *map(float, own)) for n, *own in table_of),
        draws,
    )


def _quantities(rig: Rig, press: Prediction) -> Floats:
    """Return `NAMES` of a press [SI], of its first string."""
    own = pluck_features(rig, press, press.choirs[0])
    return np.array([own[n] if n in own else getattr(press, n) for n in NAMES])


class _Distribution(BaseModel):
    model_config = ConfigDict(extra="ignore")

    names: tuple[str, ...]
    values: tuple[FiniteFloat, ...]
    covariance: tuple[tuple[FiniteFloat, ...], ...]
    low: tuple[FiniteFloat, ...] = ()
    high: tuple[FiniteFloat, ...] = ()


class _Std(BaseModel):
    model_config = ConfigDict(extra="ignore")

    std: FiniteFloat | None


class _Fit(BaseModel):
    model_config = ConfigDict(extra="ignore")

    distribution: _Distribution
    parameters: dict[str, _Std]
    also_fitted: dict[str, _Std] = {}


def read_distribution(path: Path) -> tuple[Distribution, list[str]]:
    """Read the distribution of a fit, and the names of the values that it leaves undetermined.

    Raises:
        AnalysisError: The file cannot be read, or was not written by `identify`.
    """
    how = "write it with `sautereau identify ... --json`"
    try:
        read = _Fit.model_validate_json(read_limited(path))
    except OSError as error:
        raise AnalysisError(
            f"fit {path}: cannot be read: {why_unreadable(error)}; {how}"
        ) from error
    except ValidationError as error:
        raise AnalysisError(f"fit {path}: {first_fault(error)}; {how}") from error
    own, count = read.distribution, len(read.distribution.names)
    # A fit of a version without bounds has the natural ones.
    natural = [ENDS.get(split_name(name)[1], (-np.inf, np.inf)) for name in own.names]
    low, high = own.low or [a for a, _ in natural], own.high or [b for _, b in natural]
    parts = (own.values, own.covariance, low, high)
    if {len(part) for part in (*parts, *own.covariance)} != {count}:
        raise AnalysisError(f"fit {path}: distribution: {count} names and other values; {how}")
    faults = [
        f"fit {path}: {name}: {value:.4g} is not within its bounds, {a:.4g} to {b:.4g}; {how}"
        for name, value, a, b in zip(own.names, own.values, low, high, strict=True)
        if not a <= value <= b
    ]
    if faults:
        raise AnalysisError("\n".join(faults))
    found = Distribution(own.names, *map(np.array, parts))
    unknown = [n for n, e in (read.parameters | read.also_fitted).items() if e.std is None]
    return found, unknown
