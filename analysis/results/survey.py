"""The keys of an instrument: predicted and measured touch, and its evenness over the compass.

A voiced instrument is even: from key to key its touch changes little, and smoothly. The trend of a
quantity at a key is a straight line of its logarithm over the nearest keys, an octave of them, by
the repeated medians of Siegel (1982), which a few uneven keys do not move. A key deviates by its
ratio to that trend. It is an outlier if the modified z-score of its deviation, from the median
absolute deviation, is above 3.5 (Iglewicz and Hoaglin, 1993), and fingers can feel it.

In the touch a plectrum's cut is mixed with its overlap and thickness, so that the thickness of the
tip is a quantity of its own: of 24 plectra cut twice as deep as their neighbours it finds all, and
the touch 15.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from sautereau.analysis.campaign.shape import numbers_of
from sautereau.analysis.campaign.workers import Where, run_over
from sautereau.analysis.errors import AnalysisError, ModelError
from sautereau.analysis.model.choirs import choirs
from sautereau.analysis.model.predict import predict
from sautereau.analysis.press.features import FROM_REST, Row, by_string, column
from sautereau.analysis.results.result import Result, drawing, frame_of, shown
from sautereau.analysis.session.analysed import analyse_file
from sautereau.analysis.session.compare import Mean, mean_of, pluck_features
from sautereau.analysis.text import SOME_SIMULATED, counted, table
from sautereau.rig.errors import SautereauError
from sautereau.rig.keys import InstrumentKey
from sautereau.rig.progress import tracked
from sautereau.rig.quantities import QUANTITIES
from sautereau.rig.schema import Rig

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TOUCH = ("release_force", "force_drop", "force_slope", "held_work", "release_rise")
"""Quantities of a pluck that a recording has too."""
EVEN = (*TOUCH, "plectrum_tip_thickness")  # Quantities whose evenness is computed
START = ("release_lift", "release_angle", "v_osc")  # State of the string and plectrum at release
LEAST = 5  # Fewest keys for a trend that an uneven one does not move, and for outliers
FELT = 0.07  # Least difference of 2.5 to 10 N that is felt (Pang, Tan and Durlach, 1991)


@dataclass(frozen=True)
class Touched:
    """One string of one key."""

    key: str
    string: int
    predicted: dict[str, float]
    """By the names of `EVEN` and `START`, SI; empty if the model has no solution."""
    measured: dict[str, Mean]
    """By the names of `TOUCH`, SI, over the presses of its recordings; empty without any."""

    def values(self, source: str) -> dict[str, float]:
        """Return the values of `predicted` or `measured`."""
        if source == "predicted":
            return self.predicted
        return {name: mean.value for name, mean in self.measured.items()}


@dataclass(frozen=True)
class Evenness:
    """One quantity of one string over the keys."""

    name: str
    string: int
    source: str
    """`predicted` or `measured`."""
    per_key: float | None
    """Dimensionless, relative change of the trend from one key of the table to the next, median;
    None below `LEAST` keys, which have no outliers either."""
    deviations: dict[str, float]
    """Dimensionless, relative deviation of each key from the trend, by its name."""
    spread: float
    """Dimensionless, robust standard deviation of the deviations."""
    outliers: tuple[str, ...]
    """Keys that deviate more than the others do, the largest deviation first."""


@dataclass(frozen=True, repr=False)
class Survey(Result):
    """The touch of all keys of an instrument."""

    keys: tuple[Touched, ...]
    """One for each string of each key, in the order of the table."""
    evenness: tuple[Evenness, ...]
    simulated: bool
    """Whether the stand-in made any of the recordings."""
    warnings: tuple[str, ...]
    """Keys without a prediction, and recordings without a press, with the reasons."""

    def __repr__(self) -> str:
        return f"<Survey of {counted(len({each.key for each in self.keys}), 'key')}>"

    @property
    def document(self) -> dict[str, Any]:
        """The keys and their evenness as JSON; SI units."""
        names = (*EVEN, *START)
        return {
            "simulated": self.simulated,
            "units": {name: QUANTITIES[name].unit for name in names},
            "keys": [asdict(each) for each in self.keys],
            "evenness": [asdict(each) for each in self.evenness],
            "warnings": list(self.warnings),
        }

    def lines(self) -> list[str]:
        """Return a table for each string, predicted and measured, and the evenness."""
        lines = [SOME_SIMULATED] * self.simulated
        for (string, source), found in self._series().items():
            titles = [QUANTITIES[e.name].title for e in found]
            # The table fits into a terminal.
            heads = [["key"], *(wrap(title, 11) for title in titles)]
            deep = max(map(len, heads))
            rows = []
            for each in self.keys:
                if each.string == string and (values := each.values(source)):
                    cells = [
                        f"{values[own.name] * QUANTITIES[own.name].displayed[0]:.3g}"
                        f" {100 * own.deviations[each.key]:+.1f}"
                        if each.key in own.deviations
                        else "-"
                        for own in found
                    ]
                    rows.append((each.key, *cells))
            lines.append(f"string {string}, {source}, and % of deviation from the trend:")
            heads = [*zip(*([""] * (deep - len(head)) + head for head in heads), strict=True)]
            lines += table(heads + rows, indent=2)
            for own in found:
                far = ", ".join(f"{k} {100 * own.deviations[k]:+.1f} %" for k in own.outliers)
                line = f"no slope and no outliers below {LEAST} keys"
                if own.per_key is not None:
                    line = f"{100 * own.per_key:+.2f} % per key, spread {100 * own.spread:.2g} %"
                    line += f"; outliers: {far or 'none'}"
                lines.append(f"{QUANTITIES[own.name].label}: {line}")
        return [*lines, *(f"warning: {warning}" for warning in self.warnings)]

    def _series(self) -> dict[tuple[int, str], list[Evenness]]:
        """Return the evenness of each string, predicted and measured."""
        found: dict[tuple[int, str], list[Evenness]] = {}
        for each in self.evenness:
            found.setdefault((each.string, each.source), []).append(each)
        return found

    def to_frame(self) -> "pd.DataFrame":
        """Return every quantity of every key: predicted, measured with its interval, deviation."""
        deviations = {(e.string, e.name, e.source): e.deviations for e in self.evenness}
        rows = []
        for each in self.keys:
            for name in (*EVEN, *START):
                own = [
                    deviations.get((each.string, name, s), {}) for s in ("predicted", "measured")
                ]
                mean = each.measured.get(name)
                ends = (None, None, None) if mean is None else (mean.value, mean.low, mean.high)
                found = each.predicted.get(name), *ends, *(d.get(each.key) for d in own)
                rows.append((each.key, each.string, name, *found))
        columns = ("key", "string", "name", "predicted", "measured", "low", "high",
                   "predicted_deviation", "measured_deviation")  # fmt: skip
        units = {name: QUANTITIES[name].unit for name in (*EVEN, *START)}
        return frame_of(rows, columns, ["key", "string", "name"], units)

    def plot(self) -> "Figure":
        """Return a figure of each quantity over the keys, with outliers by name."""
        from sautereau.analysis.figures.palette import GRID, MARKERS, SERIES

        figure = drawing(12, 2.6 * len(EVEN))
        order = list(dict.fromkeys(each.key for each in self.keys))
        panels: dict[str, Axes] = dict(
            zip(EVEN, figure.subplots(len(EVEN), 1, sharex=True), strict=True)
        )
        for number, ((string, source), found) in enumerate(self._series().items()):
            colour, marker = SERIES[number % len(SERIES)], MARKERS[number % len(MARKERS)]
            for own in found:
                axes, scale = panels[own.name], QUANTITIES[own.name].displayed[0]
                with_it = [e for e in self.keys if e.string == string and e.key in own.deviations]
                places = [order.index(each.key) for each in with_it]
                values = np.array([scale * each.values(source)[own.name] for each in with_it])
                label = f"{source}, string {string}"
                axes.plot(places, values, marker, color=colour, ms=4, label=label)
                axes.plot(places, values / (1 + np.array([*own.deviations.values()])), color=colour)
                for place, value, each in zip(places, values, with_it, strict=True):
                    if each.key in own.outliers:
                        beside = {"xytext": (6, 0), "textcoords": "offset points", "va": "center"}
                        axes.annotate(each.key, (place, value), fontsize=8, **beside)
        for name, axes in panels.items():
            axes.margins(y=0.1)
            axes.set_ylabel(QUANTITIES[name].title, fontsize=8)
            axes.grid(color=GRID, lw=0.7)
        panels[TOUCH[0]].legend(frameon=False, fontsize=8, ncols=4)
        panels[EVEN[-1]].set_xticks(range(len(order)), order, rotation=90, fontsize=7)
        figure.suptitle("SIMULATED: " * self.simulated + repr(self).strip("<>"))
        return shown(figure)


def survey(
    keys: Sequence[InstrumentKey],
    recordings: Mapping[str, Sequence[Path]] | None = None,
    level: str = "auto",
    where: Where = 1,
) -> Survey:
    """Predict every key, read its recordings, and compute the evenness.

    Args:
        recordings: By the name of the key.
        level: Plectrum level of the predictions.
        where: Processes or cluster that predict and read.

    Raises:
        AnalysisError: No key has a prediction or a recording that can be analysed.
    """
    read = [(key.name, path) for key in keys for path in (recordings or {}).get(key.name, ())]
    progress = tracked([*keys, *read])
    predictions = _over(
        partial(_predicted, level=level), [key.rig for key in keys], where, progress
    )
    presses = _over(_measured, [path for _, path in read], where, progress)
    names = [*(key.name for key in keys), *(name for name, _ in read)]
    results = zip(names, [*predictions, *presses], strict=True)
    warnings = [f"{name}: {why}" for name, (found, why) in results if found is None]
    warnings += [FROM_REST] * any(row.get("unseen_force") is not None for row, _ in presses if row)
    rows = []
    for key, (strings, _) in zip(keys, predictions, strict=True):
        own = [row for (name, _), (row, _) in zip(read, presses, strict=True) if name == key.name]
        for string in range(1, 2 + len(key.rig.more_choirs)):
            columns = {name: column(name, string) for name in TOUCH}
            values = {n: [row[c] for row in own if row and row.get(c)] for n, c in columns.items()}
            measured = {name: mean_of(several) for name, several in values.items() if several}
            rows.append(Touched(key.name, string, strings[string - 1] if strings else {}, measured))
    if not any(each.predicted or each.measured for each in rows):
        raise AnalysisError("\n".join(["survey: no key has a result", *warnings]))
    order = {key.name: place for place, key in enumerate(keys)}
    evenness = [
        _evenness({order[e.key]: e for e in own}, name, string, source)
        for string in sorted({each.string for each in rows})
        for source in ("predicted", "measured")
        for name in EVEN
        if (own := [e for e in rows if e.string == string and e.values(source).get(name, 0) > 0])
    ]
    simulated = any(row["simulated"] for row, _ in presses if row)
    return Survey(tuple(rows), tuple(evenness), simulated, tuple(warnings))


def _over(function: Any, items: Sequence[Any], where: Where, progress: Iterator[Any]) -> list[Any]:
    """Return the results of a function, in the order of the items."""
    found = []
    for result in run_over(function, items, where):
        next(progress)
        found.append(result)
    return [result for _, result in sorted(found, key=lambda pair: pair[0])]


def _predicted(rig: Rig, level: str) -> tuple[list[dict[str, float]] | None, str]:
    """Return the quantities of each string; or None, and why there are none."""
    try:
        found = predict(rig, level)
    except ModelError as error:
        return None, str(error)
    return [
        {name: pluck_features(rig, found, choir)[name] for name in TOUCH}
        | {"plectrum_tip_thickness": numbers_of(own.plectrum)["tip_thickness"]}
        | {name: getattr(choir, name) for name in START}
        for own, choir in zip(choirs(rig), found.choirs, strict=True)
    ], ""


def _measured(path: Path) -> tuple[Row | None, str]:
    """Return the features of a recording by string; or None, and why there are none."""
    try:
        found = analyse_file(path)
    except SautereauError as error:
        return None, str(error)
    if found.session.warm_up:
        return None, f"{path}: a warm-up press, which is omitted"
    return by_string(found.features), ""


def _evenness(own: Mapping[int, Touched], name: str, string: int, source: str) -> Evenness:
    """Return the trend of a quantity over keys by their places, and the deviations."""
    from scipy.stats import median_abs_deviation, siegelslopes

    places = np.array([*own])
    logs = np.log([each.values(source)[name] for each in own.values()])
    lines = np.tile([0.0, np.median(logs)], (len(own), 1))
    enough = len(own) >= LEAST
    for k in range(len(own) * enough):
        # Of the nearest keys, an octave with itself.
        near = np.argsort(np.abs(places - places[k]), kind="stable")[:13]
        lines[k] = siegelslopes(logs[near], places[near] - places[k])
    per_key = float(np.expm1(np.median(lines[:, 0]))) if enough else None
    residuals = logs - lines[:, 1]
    # The MAD of a normal distribution over its standard deviation.
    spread = float(median_abs_deviation(residuals)) / 0.6745
    deviations = dict(zip([e.key for e in own.values()], np.expm1(residuals).tolist(), strict=True))
    largest = np.argsort(-np.abs(residuals)).tolist() if enough else []
    # A modified z-score of 3.5 is that of an outlier (Iglewicz and Hoaglin).
    least = max(3.5 * spread, np.log1p(FELT))
    far = [k for k in largest if abs(residuals[k]) > least]
    outliers = tuple([*deviations][k] for k in far)
    return Evenness(name, string, source, per_key, deviations, spread, outliers)
