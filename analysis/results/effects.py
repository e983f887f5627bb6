"""The effects of an experiment's factors on what its presses show."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.campaign.effects import FactorEffects, FittedEffects, fit_effects, in_order
from sautereau.analysis.campaign.variance import numbered
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.figures.palette import BEFORE, DASHES, GRID, MARKERS, MEASURED, SERIES
from sautereau.analysis.press.features import (
    by_string,
    level_std,
    quantity_of,
    split_column,
    title_of,
)
from sautereau.analysis.results.result import Result, drawing, frame_of, json_of, shown
from sautereau.analysis.session.analysed import AnalysedPress
from sautereau.analysis.session.conditions import differing, what_is_alike
from sautereau.analysis.session.repeatability import interval
from sautereau.analysis.text import OF_DIFFERENCES, SOME_SIMULATED, counted, rounded, table
from sautereau.rig.faults import fault_list
from sautereau.trajectory.motion import Floats

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_TICKS = 6  # Levels of which each has its tick
DEFAULT = ("release_force", "force_drop", "force_slope", "pluck_duration")
"""Quantities of which effects are shown, unless others are given."""


@dataclass(frozen=True, repr=False)
class Effects(Result):
    """Effects of factors, by quantity."""

    fitted: Mapping[str, FittedEffects]
    """By the name of the quantity, SI units."""
    factors: Mapping[str, Sequence[str]]
    """Level of each press by factor."""
    order: Mapping[str, Sequence[str]]
    """Levels in their order by factor."""
    values: Mapping[str, Floats]
    """Of each press by quantity, SI units; NaN for none."""
    blocks: NDArray[np.intp]
    """Number of each press's block, over all sessions."""
    simulated: bool
    """Whether the stand-in made any of the presses."""
    notes: tuple[str, ...]
    """Quantities without effects, with the reasons."""

    def __repr__(self) -> str:
        presses = counted(len(self.blocks), "press")
        return f"<Effects of {', '.join(self.factors)} on {presses}>"

    @property
    def document(self) -> dict[str, Any]:
        """The effects as JSON; SI units."""
        return {
            "simulated": self.simulated,
            "presses": len(self.blocks),
            "blocks": len(set(self.blocks.tolist())),
            "factors": {name: list(levels) for name, levels in self.order.items()},
            "units": {name: quantity_of(name).unit for name in self.fitted},
            "effects": {name: json_of(fit, "residuals") for name, fit in self.fitted.items()},
            "notes": list(self.notes),
        }

    def lines(self) -> list[str]:
        """Return a table of means and differences for each quantity."""
        lines = [SOME_SIMULATED] * self.simulated
        lines += [
            f"{counted(len(self.blocks), 'press')},"
            f" {counted(len(set(self.blocks.tolist())), 'block')}",
            f"in brackets {OF_DIFFERENCES}",
        ]
        for name, fit in self.fitted.items():
            lines += _fitted_lines(name, fit)
        reasons = [(name, f.reason) for name, f in self.fitted.items() if f.reason]
        same = len(reasons) == len(self.fitted) and len({reason for _, reason in reasons}) == 1
        said = reasons[:1] if same else reasons
        lines += [
            "note: least squares" + f" of {name}" * (not same) + f": {reason}"
            for name, reason in said
        ]
        return [*lines, *(f"note: {note}" for note in self.notes)]

    def to_frame(self) -> "pd.DataFrame":
        """Return every difference from the first level, with its interval."""
        rows = [
            (name, e.factor, e.level, e.value, e.low, e.high, e.std, e.degrees)
            for name, fit in self.fitted.items()
            for factor in fit.factors
            for e in factor.effects
        ]
        columns = ("name", "factor", "level", "value", "low", "high", "std", "degrees")
        units = {name: quantity_of(name).unit for name in self.fitted}
        return frame_of(rows, columns, ["name", "factor", "level"], units)

    def plot(self) -> "Figure":
        """Return a figure with a row for each quantity, a column for each factor and interaction.

        In a factor's column, points are presses: the mean of their level plus their residual,
        without the effects of the other factors. That of an interaction has the mean of each
        combination.
        """
        count = max(len(fit.factors) for fit in self.fitted.values())
        size = (max(6.4, 4.2 * count), 0.8 + 2.4 * len(self.fitted))  # inches
        figure = drawing(*size)
        panels = figure.subplots(len(self.fitted), count, sharey="row", squeeze=False)
        for number, (name, fit) in enumerate(self.fitted.items()):
            scale, _ = quantity_of(name).displayed
            for axes, factor in zip(panels[number], fit.factors, strict=False):
                if factor.means:
                    _levels(axes, factor, self.factors[factor.name], fit.residuals, scale)
                else:
                    _combinations(axes, factor, self, scale * self.values[name])
                    if number == 0:
                        axes.legend(
                            title=factor.of[0], frameon=False, fontsize=7, title_fontsize=7,
                            ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0),
                        )  # fmt: skip
                axes.grid(color=GRID, lw=0.7)
                axes.set_axisbelow(True)
            for axes in panels[number, len(fit.factors) :]:
                axes.set_axis_off()
            panels[number, 0].set_ylabel(title_of(name).replace(" (", "\n("))
        title = "SIMULATED: " * self.simulated + repr(self).strip("<>")
        figure.suptitle(f"{title}\nbars: {OF_DIFFERENCES}", fontsize=10)
        return shown(figure)


def effects_of(
    presses: Sequence[AnalysedPress], names: Sequence[str] = DEFAULT, *, interaction: bool = False
) -> Effects:
    """Estimate the effects of the factors in which presses differ.

    The factors are those of a design or, without one, the values of the rig that differ. Blocks are
    those of the design in each session; without one, the sessions, and folders of recordings that
    name no session, such as imported ones. Warm-up presses are omitted.

    Args:
        names: Features of a press; those of string 2 end in `_2`.
        interaction: Whether to estimate the interactions of every two factors.

    Raises:
        AnalysisError: A name is unknown, the presses have no factor, or no quantity has effects.
    """
    presses = [press for press in presses if not press.session.warm_up]
    alike = what_is_alike(presses)
    factors = _factors(presses, alike)
    order = {factor: _ordered(own, alike) for factor, own in factors.items()}
    sessions = [p.session.session or p.press.path.absolute().parent for p in presses]
    of_session = list(zip(sessions, (p.session.block for p in presses), strict=True))
    blocks = numbered(of_session)
    rows = [by_string(press.features) for press in presses]
    if unknown := [name for name in names if split_column(name)[0] not in rows[0]]:
        raise AnalysisError(
            f"effects: {', '.join(unknown)}: no such feature of a press; give some of"
            f" {', '.join(DEFAULT)}, or others of the glossary"
        )
    fitted, values, faults = {}, {}, []
    for name in dict.fromkeys(names):
        own = [row.get(name) for row in rows]
        values[name] = np.array([v if isinstance(v, float | int) else np.nan for v in own], float)
        try:
            fitted[name] = fit_effects(
                values[name],
                factors,
                blocks,
                stds=np.array([level_std(row, name) for row in rows]),
                interaction=interaction,
                order=order,
            )
        except AnalysisError as error:
            faults.append(f"{name}: {str(error).removeprefix('effects: ')}")
    if not fitted:
        raise AnalysisError(fault_list("effects", faults))
    simulated = any(press.press.simulated for press in presses)
    return Effects(fitted, factors, order, values, blocks, simulated, tuple(faults))


def _factors(
    presses: Sequence[AnalysedPress], alike: Sequence[Mapping[str, Any]]
) -> dict[str, list[str]]:
    """Return the levels of presses by factor.

    Args:
        alike: Values of the rig, scene and day of each press.
    """
    designs = {tuple(sorted(press.session.levels)) for press in presses}
    if len(designs) > 1:
        raise AnalysisError(
            "effects: these presses are of designs with different factors, or some of none; give"
            " presses of one design"
        )
    if presses and presses[0].session.levels:
        return {f: [p.session.levels[f] for p in presses] for f in presses[0].session.levels}
    keys = {k: None for own in alike[1:] for k in differing(alike[0], own)}
    keys = [key for key in keys if key not in ("day", "name") and not key.startswith("scene")]
    if not keys:
        raise AnalysisError(
            "effects: the presses do not differ in a value of the rig; press a design of several"
            " levels (press --design)"
        )
    # Without the last digits, which are those of the conversion to SI.
    return {key: [rounded(own.get(key), 12) for own in alike] for key in keys}


def _ordered(levels: Sequence[str], alike: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """Return the levels of a factor in the order of their numbers.

    Levels with names are in the order of the first number of the rig that each has to itself.
    """
    first = {level: alike[levels.index(level)] for level in in_order(levels)}
    if any(level.partition(" ")[0].replace(".", "", 1).isdigit() for level in first):
        return tuple(first)
    for key in next(iter(first.values()), {}):
        own = {level: str(values.get(key)) for level, values in first.items()}
        same = all(str(v.get(key)) == own[level] for level, v in zip(levels, alike, strict=True))
        if same and len(set(own.values())) == len(own) > 1:
            place = {text: n for n, text in enumerate(in_order(list(own.values())))}
            return tuple(sorted(first, key=lambda level: place[own[level]]))
    return tuple(first)


def _fitted_lines(name: str, fit: FittedEffects) -> list[str]:
    scale, _ = quantity_of(name).displayed
    lines = [f"{title_of(name)}, {counted(fit.presses, 'press')}, {fit.model}:"]
    for factor in fit.factors:
        p_value = "p < 0.0001" if factor.p_value < 1e-4 else f"p = {factor.p_value:.2g}"
        effects = {effect.level: interval(effect, scale, 3) for effect in factor.effects}
        rows: list[tuple[str, ...]] = [("level", "interaction"), *effects.items()]
        if factor.means:
            rows = [("level", "mean", f"difference from {factor.means[0].level}")] + [
                (mean.level, interval(mean, scale), effects.get(mean.level, ""))
                for mean in factor.means
            ]
        lines += [f"  {factor.name}, {p_value}", *table(rows, indent=4)]
    deviations = f"press {scale * fit.press_std:.3g}"
    if fit.block_std is not None:
        deviations += f", block {scale * fit.block_std:.3g}"
    lines.append(f"  standard deviations: {deviations}")
    if fit.omitted:
        lines.append(f"  omitted: {counted(fit.omitted, 'press')} without this quantity")
    return lines


def _levels(
    axes: "Axes", factor: FactorEffects, own: Sequence[str], residuals: Floats, scale: float
) -> None:
    """Draw the presses of each level, and its mean.

    Args:
        own: Level of each press.
    """
    levels = [mean.level for mean in factor.means]
    places = _places(axes, factor.name, levels)
    means = scale * np.array([(m.value, m.value - m.low, m.high - m.value) for m in factor.means])
    known = np.flatnonzero(np.isfinite(residuals)).tolist()
    number = [levels.index(own[press]) for press in known]
    presses = means[number, 0] + scale * residuals[known]
    axes.plot(places[number], presses, ".", color=BEFORE, ms=4)
    style = {"fmt": "o", "color": MEASURED, "ms": 4, "capsize": 5}
    axes.errorbar(places, means[:, 0], means[:, 1:].T, **style)


def _combinations(axes: "Axes", factor: FactorEffects, found: Effects, values: Floats) -> None:
    """Draw the mean of the presses of each combination, a line for each level of one factor."""
    first, second = factor.of
    levels = list(found.order[second])
    places = _places(axes, second, levels)
    own, other = np.asarray(found.factors[first]), np.asarray(found.factors[second])
    for number, level in enumerate(found.order[first]):
        means = [np.nanmean(values[(own == level) & (other == each)]) for each in levels]
        marker, colour = MARKERS[number % len(MARKERS)], SERIES[number % len(SERIES)]
        dashes = DASHES[number % len(DASHES)]
        axes.plot(places, means, marker=marker, color=colour, ls=dashes, label=level, ms=4)


def _places(axes: "Axes", name: str, levels: list[str]) -> Floats:
    """Return the places of levels, and label the axis.

    Quantities of one unit stand at their values, other levels at equal distances.
    """
    numbers, _, units = zip(*(level.partition(" ") for level in levels), strict=True)
    try:
        places = np.array([float(number) for number in numbers])
        if len(set(units)) > 1:
            raise ValueError
        axes.set_xlabel(f"{name} ({units[0]})" if units[0] else name)
        close = float(np.diff(places).min()) < float(np.ptp(places)) / (2 * MOST_TICKS)
        if len(levels) <= MOST_TICKS and not close:
            axes.set_xticks(places, numbers)
        else:
            axes.locator_params(axis="x", nbins=MOST_TICKS)
    except ValueError:
        places = np.arange(len(levels), dtype=float)
        axes.set_xticks(places, levels)
        axes.set_xlim(-0.5, len(levels) - 0.5)
        axes.set_xlabel(name)
    return places
