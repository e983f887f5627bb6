"""The press that the model predicts."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, FiniteFloat, ValidationError

from sautereau.analysis.alike import INSTRUMENT
from sautereau.analysis.errors import AnalysisError, ModelError
from sautereau.analysis.identify.information import Distribution
from sautereau.analysis.identify.parameters import ENDS, rig_numbers, split_name, with_parameters
from sautereau.analysis.model import predict as model
from sautereau.analysis.model.choirs import hold, string_names
from sautereau.analysis.model.string.string import first_mode_release_speed
from sautereau.analysis.results.result import Result, drawing, frame_of, named, part_of, shown
from sautereau.analysis.session.compare import pluck_features
from sautereau.analysis.session.repeatability import student
from sautereau.analysis.text import counted, table
from sautereau.rig.disk import read_limited, why_unreadable
from sautereau.rig.document import flat, rig_document
from sautereau.rig.errors import RigError
from sautereau.rig.faults import first_fault
from sautereau.rig.progress import tracked
from sautereau.rig.quantities import QUANTITIES
from sautereau.rig.schema import Rig
from sautereau.rig.units import shown as shown_value
from sautereau.trajectory.motion import Floats

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Parts = TypeVar("Parts", bound=BaseModel)
DRAWS = 256  # Of the fit's distribution: the ends of an interval are within 5 % of its width
LEAST = 0.9  # Fraction of the draws that must have a pluck, so that the interval is one of plucks
LISTED = 5  # Largest number of values in a list of differences
NAMES = ("release_force", "force_drop", "work", "pluck_duration", "peak_force", "v_osc")
"""Quantities of the press that a fit predicts."""
OF_OUTLINE: tuple[str, ...] = (
    "release_force", "force_drop", "force_slope", "work", "pluck_duration", "plectrum_force",
    "release_angle", "release_lift", "v_osc",
)  # fmt: skip
"""Quantities of the press of a photographed plectrum."""
MATERIAL = ("youngs_modulus", "poisson_ratio", "width", "friction")  # Not in an outline


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
    photograph: float | None = None
    """Half of the 95 % interval that the photograph alone causes; None: there is none."""


@dataclass(frozen=True, repr=False)
class Predicted(Result):
    """Quantities of a press with the intervals that uncertain values cause."""

    rig: Rig
    """With the fitted values, or with the outline of the photograph."""
    level: str
    intervals: tuple[Interval, ...]
    draws: Floats
    """SI, the quantities in each draw with a pluck; shape (draws, quantities)."""
    origin: str
    """What the draws are from, as texts say it."""
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        force = self.intervals[0]
        return f"<Predicted for rig {self.rig.name}: {_cells(force)[1]} N at release>"

    @property
    def document(self) -> dict[str, Any]:
        """The quantities as JSON; SI units."""
        return {
            "level": self.level,
            "draws": len(self.draws),
            "quantities": named(self.intervals),
            "warnings": list(self.warnings),
        }

    def lines(self) -> list[str]:
        """Return the prediction as text."""
        heads = ("", "value", "std", "95 % interval", "unit")
        if any(own.photograph is not None for own in self.intervals):
            heads = (*heads, "photograph alone, +-")
        return [
            f"rig {self.rig.name}, plectrum model {self.level}; intervals from"
            f" {counted(len(self.draws), 'draw')} {self.origin}:",
            *table([heads, *map(_cells, self.intervals)], left=(0, 4), indent=2),
            *(f"warning: {warning}" for warning in self.warnings),
        ]

    def to_frame(self) -> "pd.DataFrame":
        """Return each quantity with its unit, standard uncertainty and 95 % interval."""
        columns = list(Interval.__dataclass_fields__)
        return frame_of([[getattr(i, c) for c in columns] for i in self.intervals], columns, "name")

    def plot(self) -> "Figure":
        """Return a figure of the distribution of each quantity."""
        figure = drawing(12, 6)
        panels = figure.subplots(-(-len(self.intervals) // 3), 3).ravel()
        for axes, own, draws in zip(panels, self.intervals, self.draws.T, strict=True):
            scale, _ = QUANTITIES[own.name].displayed
            axes.hist(draws * scale, bins=24)
            axes.axvline(own.value * scale, color="black")
            axes.set(xlabel=QUANTITIES[own.name].title, ylabel="draws")
            axes.locator_params("x", nbins=5)
        return shown(figure)


def _cells(own: Interval) -> tuple[str, ...]:
    scale, unit = QUANTITIES[own.name].displayed
    value, std, low, high = (f"{x * scale:.4g}" for x in (own.value, own.std, own.low, own.high))
    cells = QUANTITIES[own.name].label, value, std, f"{low} to {high}", unit
    return cells if own.photograph is None else (*cells, f"{own.photograph * scale:.2g}")


def predicted(
    rig: Rig,
    fitted: Distribution,
    undetermined: Sequence[str] = (),
    instrument: Mapping[str, Any] | None = None,
    *,
    level: str = "auto",
) -> Predicted:
    """Return the press that a fit predicts for a rig.

    Args:
        rig: All other values are those of this rig.
        undetermined: Names of values that the fit could not determine.
        instrument: Instrument of the fit, as `identify` writes it; None if it is that of the rig.
            A warning lists what differs.

    Raises:
        AnalysisError: There are such values, or less than nine of ten draws have a pluck.
        ModelError: The model has no solution for the fitted values.
    """
    if undetermined:
        raise AnalysisError(
            f"predict: the fit leaves {', '.join(undetermined)} undetermined, so that the press has"
            " no interval; give a prior, or free fewer parameters"
        )

    def press(values: Floats) -> tuple[Rig, model.Prediction]:
        named = dict(zip(fitted.names, values.tolist(), strict=True))
        moved = with_parameters(rig, named)
        return moved, model.predict(moved, level)

    made, best = press(fitted.values)
    rows = []
    for draw in fitted.drawn(DRAWS):
        try:
            rows.append(quantities(*press(draw)))
        except (ModelError, RigError):
            continue
    if len(rows) < LEAST * DRAWS:
        raise AnalysisError(
            f"predict: {len(rows)} of {DRAWS} draws of the fit's distribution have a pluck, and"
            f" {LEAST * DRAWS:.0f} are needed: the values are too uncertain; record more presses,"
            " or give priors"
        )
    draws: Floats = np.array(rows)
    lows, highs = np.quantile(draws, (0.025, 0.975), axis=0)
    stds = draws.std(axis=0, ddof=1)
    table_of = zip(NAMES, quantities(made, best), stds, lows, highs, strict=True)
    return Predicted(
        made,
        best.level,
        tuple(Interval(n, QUANTITIES[n].unit, *map(float, own)) for n, *own in table_of),
        draws,
        "of the fit's distribution",
        () if instrument is None else tuple(_differences(rig, fitted, instrument)),
    )


def _differences(rig: Rig, fitted: Distribution, instrument: Mapping[str, Any]) -> Iterator[str]:
    """Yield a warning of the values in which a rig differs from the instrument of a fit."""
    if not instrument:
        yield "the fit is of an earlier version, and does not say of which instrument it is"
        return
    of_fit = rig_numbers(rig, dict(zip(fitted.names, fitted.values.tolist(), strict=True)))
    own, other = flat(rig_document(rig)), flat(instrument)
    keys = [
        key
        for key in {**own, **other}
        if key.partition(".")[0] in INSTRUMENT
        and own.get(key) != other.get(key)
        and key not in of_fit
    ]
    if keys:
        pairs = [(shown_value(own.get(key)), shown_value(other.get(key))) for key in keys]
        listed = [f"{key} {a} (fit: {b})" for key, (a, b) in zip(keys, pairs, strict=True)]
        more = [f"and {len(keys) - LISTED} more"] * (len(keys) > LISTED)
        yield (
            "the fit is of another instrument, and its values may be wrong for this one:"
            f" {'; '.join([*listed[:LISTED], *more])}"
        )


def of_outline(rig: Rig, level: str = "auto", string: int = 1) -> Predicted | None:
    """Return the press of a photographed plectrum with the intervals; None without an ensemble.

    The half of an interval has two independent parts: of the photograph, Student's t times the
    standard deviation over the outline's ensemble; of the material, the change at the end of each
    assumed range of `MATERIAL`. At the level `fe` the ratios of the members' quantities to those of
    the outline are computed by `elastica`.

    Args:
        string: Number of the string whose quantities and material they are.

    Raises:
        AnalysisError: Less than nine of ten members have a pluck.
        ModelError: The model has no solution for the outline.
    """
    outlines = members(rig)
    if not outlines:
        return None
    at = "" if string == 1 else f"more_choirs.{string - 2}."
    keys = [f"{at}plectrum.{name}" for name in MATERIAL]
    ends = [rig.replaced({key: end}) for key in keys for end in rig.assumed.get(key, ())]
    best = model.predict(rig, level)
    value = quantities(rig, best, OF_OUTLINE, string)
    of_material = np.array([_row(level, own, string) for own in tracked(ends)]).reshape(
        -1, len(value)
    )
    # The elements of all members take a minute, and what the elastica neglects is the same in all.
    near = "elastica" if "fe" in best.level else level
    rows = [_row(near, own, string) for own in tracked([rig, *outlines])]
    drawn = np.array([value * (row / rows[0]) for row in rows[1:] if np.isfinite(row).all()])
    if not np.isfinite(rows[0]).all() or len(drawn) < LEAST * len(outlines):
        raise AnalysisError(
            f"predict: {len(drawn)} of {len(outlines)} outlines of the ensemble have a pluck;"
            " photograph the plectrum more sharply"
        )
    std = drawn.std(axis=0, ddof=1)
    photograph = student(len(drawn) - 1) * std
    change = np.nan_to_num(of_material - value)  # without a pluck at an end
    lower, upper = (np.sqrt(np.sum(f(change, 0) ** 2, axis=0)) for f in (np.minimum, np.maximum))
    rows = zip(
        OF_OUTLINE,
        value,
        std,
        value - np.hypot(photograph, lower),
        value + np.hypot(photograph, upper),
        photograph,
        strict=True,
    )
    intervals = tuple(Interval(n, QUANTITIES[n].unit, *map(float, own)) for n, *own in rows)
    origin = "of the photographed outline" + ", and from the material's range" * bool(ends)
    return Predicted(rig, best.level, intervals, drawn, origin)


def members(rig: Rig) -> list[Rig]:
    """Return the rig with each outline of its plectra's ensembles; none if no plectrum has one."""
    plectra = [rig.plectrum, *(choir.plectrum for choir in rig.more_choirs)]
    ensembles = [plectrum.ensemble or (plectrum,) for plectrum in plectra]
    count = max(map(len, ensembles))
    if count == 1:
        return []
    found = []
    for number in range(count):
        first, *others = (own[number % len(own)] for own in ensembles)
        choirs = tuple(
            choir.model_copy(update={"plectrum": plectrum})
            for choir, plectrum in zip(rig.more_choirs, others, strict=True)
        )
        found.append(rig.model_copy(update={"plectrum": first, "more_choirs": choirs}))
    return found


def _row(level: str, rig: Rig, string: int) -> Floats:
    """Return `OF_OUTLINE` of a rig's press [SI]; NaN without a pluck."""
    try:
        return quantities(rig, model.pressed(rig, hold(rig, level), level), OF_OUTLINE, string)
    except ModelError:
        return np.full(len(OF_OUTLINE), np.nan)


def quantities(
    rig: Rig, press: model.Prediction, names: Sequence[str] = NAMES, string: int = 1
) -> Floats:
    """Return quantities of a press [SI], of one of its strings by its number."""
    choir = press.choirs[string - 1]
    # The model's exact instants and states, and only then what a recording shows.
    own = pluck_features(rig, press, choir) | {"peak_force": press.peak_force}
    return np.array([getattr(choir, n) if hasattr(choir, n) else own[n] for n in names])


class Written(BaseModel):
    """A part of what `identify --json` has written."""

    model_config = ConfigDict(extra="ignore")


class _Distribution(Written):
    names: tuple[str, ...]
    values: tuple[FiniteFloat, ...]
    covariance: tuple[tuple[FiniteFloat, ...], ...]
    low: tuple[FiniteFloat, ...] = ()
    high: tuple[FiniteFloat, ...] = ()


class _Std(Written):
    std: FiniteFloat | None


class _Fit(Written):
    distribution: _Distribution
    instrument: dict[str, Any] = {}
    parameters: dict[str, _Std]
    also_fitted: dict[str, _Std] = {}


def read_part(path: Path, model: type[Parts], how: str) -> Parts:
    """Read what a model names of a file that `identify --json` has written.

    Args:
        how: How to correct a file that is none.

    Raises:
        AnalysisError: The file cannot be read, or was not written by `identify`.
    """
    try:
        return model.model_validate_json(read_limited(path))
    except OSError as error:
        why = why_unreadable(error)
        raise AnalysisError(f"fit {path}: cannot be read: {why}; {how}") from error
    except ValidationError as error:
        raise AnalysisError(f"fit {path}: {first_fault(error)}; {how}") from error


def read_distribution(path: Path) -> tuple[Distribution, list[str], dict[str, Any]]:
    """Read the distribution of a fit, the names of values that it leaves undetermined, and its rig.

    The rig has the tables of the instrument; none if the fit is of an earlier version.

    Raises:
        AnalysisError: The file cannot be read, or was not written by `identify`.
    """
    how = "write it with `sautereau identify ... --json`"
    read = read_part(path, _Fit, how)
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
    return found, unknown, read.instrument


COLUMNS = {"rise": "m", "deflection": "m", "finger_force": "N", "string_force": "N"}
"""Columns of the table and their units."""


@dataclass(frozen=True, repr=False)
class Prediction(Result):
    """The model's press of a rig; `press` has all its arrays."""

    rig: Rig
    press: model.Prediction

    def __repr__(self) -> str:
        return (
            f"<Prediction for rig {self.rig.name}: pluck of"
            f" {self.press.pluck_duration * 1e3:.4g} ms, force at release"
            f" {self.press.release_force:.4g} N>"
        )

    @property
    def document(self) -> dict[str, Any]:
        """Durations, forces and speeds as JSON, SI: of string 1, and in `choirs` of each string."""
        found = self.press
        names = ("contact", "release", "pluck_duration", "release_force", "plectrum_force",
                 "release_lift", "release_angle", "peak_force", "work", "v_osc")  # fmt: skip
        state = found.choirs[0].released_string  # at a fold a speed is infinite, and None here
        of_choir = ("contact", "release", "pluck_duration", "plectrum_force", "release_lift",
                    "release_angle", "work")  # fmt: skip
        return {
            "string": 1,
            **part_of(found, *names),
            "level": found.level,
            "warnings": list(found.warnings),
            "v_osc_first_mode": first_mode_release_speed(self.rig.string, found.release_lift),
            "released_string": {
                name: speed if math.isfinite(speed := getattr(state, name)) else None
                for name in ("x", "z", "velocity_x", "velocity_z")
            },
            "choirs": [
                {"string": k, **part_of(choir, *of_choir), "gives_way": choir.released_at_fold}
                for k, choir in enumerate(found.choirs, 1)
            ],
        }

    @property
    def scalars(self) -> dict[str, Any]:
        """Durations, forces and speeds of the press, SI, by the names of the glossary."""
        return self.document

    def lines(self) -> list[str]:
        """Return the prediction as text."""
        found = self.press
        first_mode = first_mode_release_speed(self.rig.string, found.release_lift)
        lines = [
            f"rig {self.rig.name}, plectrum model {found.level}, jack speed"
            f" {self.rig.press.jack_speed:.4g} m/s; times after the jack leaves rest:"
        ]
        several, strings = len(found.choirs) > 1, string_names(self.rig)
        for string, choir in zip(strings, found.choirs, strict=True):
            name = f"{string}: " if several else ""
            early = (
                ", before the tip: the plectrum's deflection reaches its limit"
                * choir.released_at_fold
            )
            lines += [
                f"{name}contact {choir.contact * 1e3:.4g} ms, release {choir.release * 1e3:.4g} ms"
                f"{early}; {_shown('pluck_duration', choir.pluck_duration)}",
                *(
                    f"  {_shown(quantity, getattr(choir, quantity))}"
                    for quantity in ("plectrum_force", "release_lift", "release_angle")
                ),
            ]
        first = f" of {strings[0]}" * several
        return [
            *lines,
            f"finger: {_shown('release_force', found.release_force)}{first},"
            f" {_shown('peak_force', found.peak_force)},"
            f" {_shown('work', found.work)}{' (all strings)' * several}",
            f"{QUANTITIES['v_osc'].label}{first}: {found.v_osc:.4g} m/s (all modes);"
            f" largest velocity of the first mode alone: {first_mode:.3g} m/s",
            *(f"warning: {warning}" for warning in found.warnings),
        ]

    def intervals(self, *, level: str = "auto") -> Predicted | None:
        """Return the press with the intervals that a photographed outline causes; None without one.

        Args:
            level: Of the plectra, as in the prediction.

        Raises:
            AnalysisError: Less than nine of ten outlines of the ensemble have a pluck.
        """

        return of_outline(self.rig, level)

    def to_frame(self) -> "pd.DataFrame":
        """Return the motion and the forces over the time in s after the jack leaves rest."""
        import pandas as pd

        columns = {name: getattr(self.press, name) for name in COLUMNS}
        frame = pd.DataFrame(columns, pd.Index(self.press.time, name="time"))
        frame.attrs = {"units": {"time": "s", **COLUMNS}, "level": self.press.level}
        return frame

    def plot(self) -> "Figure":
        """Return a figure of the pluck by every plectrum model."""
        from sautereau.analysis.figures.pluck import pluck_figure
        from sautereau.analysis.model.plectrum.levels import AUTO, LEVELS

        return shown(pluck_figure(self.rig, [n for n in LEVELS.names() if n != AUTO]))


def _shown(name: str, value: float) -> str:
    """Return a quantity with its label, in the unit of texts."""
    quantity = QUANTITIES[name]
    scale, unit = quantity.displayed
    return f"{quantity.label} {value * scale:.4g} {unit}"
