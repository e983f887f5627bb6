"""Plots of presses and prediction; simulated presses are marked in the plot."""

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.gridspec import SubplotSpec

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.figures.palette import AGAINST, MEASURED, PREDICTED, SERIES, how_made, stamp
from sautereau.analysis.figures.phases import scale_to_pluck, shade_phases
from sautereau.analysis.loading.press import Press, load_press
from sautereau.analysis.model.predict import Prediction
from sautereau.analysis.phases import Phases
from sautereau.analysis.session.compare import ERRORS, Comparison, listed_contributions
from sautereau.analysis.session.conditions import Condition, SessionAnalysis, label_of
from sautereau.analysis.session.difference import Pair
from sautereau.analysis.text import counted
from sautereau.rig.quantities import QUANTITIES

BESIDE = 5e-3  # s, before contact and after release, that is drawn of force on deflection
PICTURED = 8  # Number of presses of a condition that its plot shows, the first ones
ROWS = 3  # Largest number of conditions that each have a row of a plot
LISTED = 40  # Number of conditions that one overview shows, the first ones
NAMED = 3  # Number of values that name a condition in an overview
SIZE = (12, 6.5)  # Inches, of the plot of a condition
COLOURS = (MEASURED, AGAINST)  # Of the first set and of the other

BAR = 0.27  # Height of a bar, of which an input has three

_Set = tuple[Sequence[Press], Sequence[Phases]]


def comparison_figure(
    presses: Sequence[Press], phases: Sequence[Phases], prediction: Prediction
) -> Figure:
    """Return a figure of deflection and force with the phases, and of force on deflection.

    The first press is drawn over time with the three phases marked, as in the paper's
    figure 7; all presses and the prediction are drawn aligned at contact, as in figure 8.

    Raises:
        AnalysisError: There is no press to draw.
    """
    if not presses:
        raise AnalysisError("there is no press to draw; give at least one recording")
    figure = Figure(figsize=SIZE, layout="constrained")
    _draw(figure, [(presses, phases)], prediction)
    return figure


def session_figure(
    found: SessionAnalysis, pairs: Sequence[Pair] = (), number: int | None = None
) -> Figure:
    """Return a figure with a row as of `comparison_figure` for each condition of a session.

    More than `ROWS` conditions are drawn over each other, with the model errors of each; of pairs
    only the first ones are drawn.

    Args:
        pairs: Conditions of another set, drawn beside those of the session.
        number: Number of the only condition to draw, from 1; None for all.

    Raises:
        AnalysisError: There is no such condition, or nothing to draw.
    """
    count = len(found.conditions)
    chosen = [(n, c) for n, c in enumerate(found.conditions, 1) if number in (None, n)]
    if not chosen:
        raise AnalysisError(f"condition {number}: the session has 1 to {count}")
    rows = [(n, c, c.prediction) for n, c in chosen if c.prediction and c.counted]
    if not rows:
        why = dict.fromkeys(w for _, c in chosen for w in c.warnings or ["only warm-up presses"])
        raise AnalysisError(f"nothing to draw: {'; '.join(why)}")
    if pairs:
        rows = rows[:ROWS]
    if len(rows) > ROWS:
        return _overview([c for _, c, _ in rows], count)
    figure = Figure(figsize=(SIZE[0], len(rows) * SIZE[1]), layout="constrained")
    parts = figure.subfigures(len(rows), squeeze=False)[:, 0]
    for part, (n, condition, prediction) in zip(parts, rows, strict=True):
        sets = []
        for each in (condition, *(pair.second for pair in pairs if pair.first is condition)):
            first = each.counted[:PICTURED]
            sets.append(
                ([load_press(press.press.path) for press in first], [p.phases for p in first])
            )
        _draw(part, sets, prediction, condition.comparison)
        if count > 1:
            title = f"condition {n} of {count}, {found.label(condition)}"
            part.suptitle(f"{part.get_suptitle()}\n{textwrap.fill(title, 120)}")  # Characters
    return figure


def _overview(conditions: Sequence[Condition], count: int) -> Figure:
    """Return a figure of the first press of each condition, its model, and all model errors.

    Args:
        count: Number of conditions of the session.
    """
    shown = conditions[:LISTED]
    keys = list(dict.fromkeys(key for each in conditions for key in each.changed))
    names = [label_of(each, keys[:NAMED], values_only=True) for each in shown]
    height = max(SIZE[1], 1.5 + 0.2 * len(shown))
    figure = Figure(figsize=(SIZE[0], height), layout="constrained")
    grid = figure.add_gridspec(1, 4, width_ratios=(3, 1, 1, 1))
    left, first = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[0, 1])
    panels = [first, *(figure.add_subplot(grid[0, k], sharey=first) for k in (2, 3))]
    colours = colormaps["viridis"](np.linspace(0, 0.9, len(shown)))
    for colour, each in zip(colours, shown, strict=True):
        string = each.comparison.string if each.comparison else 1
        plucked = [p for p in each.counted if p.phases.of_string(string)][:1]
        for press in plucked:
            _pluck(left, load_press(press.press.path), press.phases, string, color=colour)
        if plucked and each.prediction and string <= len(each.prediction.choirs):
            deflection, force = each.prediction.from_contact(BESIDE, string)
            left.plot(deflection * 1e3, force, color=colour, ls="--", lw=0.8)
    left.set(xlabel="deflection at the laser from contact (mm)", ylabel="finger force (N)")
    left.set_title("first press of each condition (-), model (--)", fontsize=9)
    for axes, name in zip(panels, ERRORS, strict=True):
        for place, (colour, each) in enumerate(zip(colours, shown, strict=True)):
            if each.comparison:
                error, ends = getattr(each.comparison, name), each.comparison.interval(name)
                axes.plot(100 * error.value, place, "o", color=colour, ms=4)
                axes.plot(100 * np.array(ends or [np.nan] * 2), [place] * 2, color=colour, lw=1)
        axes.axvline(0.0, color=PREDICTED, lw=0.8)
        axes.set_xlabel("model error (%)", fontsize=8)
        axes.set_title(QUANTITIES[name].label, fontsize=8)
        axes.tick_params(labelleft=axes is first, labelsize=7)
    first.set_yticks(range(len(shown)), names, fontsize=7)
    first.set_ylim(len(shown) - 0.5, -0.5)
    presses = [press for each in conditions for press in each.counted]
    simulated = any(press.press.simulated for press in presses)
    part = f", the first {LISTED} of them" * (len(shown) < len(conditions))
    figure.suptitle(
        f"Rig {shown[0].rig.name}: {counted(len(presses), 'press')} in {count} conditions{part},"
        f" {how_made(simulated)}\n{', '.join(keys[:NAMED])}{', ...' * (len(keys) > NAMED)};"
        " lines of errors: 95 % intervals",
        fontsize=10,
    )
    stamp(figure, simulated)
    return figure


def _draw(
    figure: FigureBase,
    sets: Sequence[_Set],
    prediction: Prediction,
    compared: Comparison | None = None,
) -> None:
    """Draw one or two sets of presses, the prediction of the first, and what explains its error."""
    grid = figure.add_gridspec(2, 2, width_ratios=(1.25, 1), height_ratios=(1.6, 1))
    top = figure.add_subplot(grid[0, 0])
    below = figure.add_subplot(grid[1, 0], sharex=top)
    budgeted = compared is not None and _budget(figure, grid[1, 1], compared)
    right = figure.add_subplot(grid[0 if budgeted else slice(None), 1])
    plucks = [held.string or 0 for found in sets[0][1] for held in found.plucks]
    string = min([len(prediction.choirs), *filter(None, plucks)]) if any(plucks) else 1
    _over_time(top, below, sets, prediction, string)
    _force_on_deflection(right, sets, prediction, string)
    simulated = any(press.simulated for presses, _ in sets for press in presses)
    numbers = " against ".join(counted(len(presses), "press") for presses, _ in sets)
    figure.suptitle(f"Rig {sets[0][0][0].rig.name}: {numbers}, {how_made(simulated)}")
    stamp(figure, simulated)


def _over_time(top, below, sets: Sequence[_Set], prediction: Prediction, string: int) -> None:
    for (presses, _), colour, of_set in zip(sets, COLOURS, _names(sets), strict=False):
        press = presses[0]
        label = f"{of_set}{press.path.name}, {_label(press)}"
        top.plot(press.time * 1e3, press.samples["deflection"] * 1e3, color=colour, label=label)
        below.plot(press.time * 1e3, press.samples["force"], color=colour, lw=0.8)
    press, phases = sets[0][0][0], sets[0][1][0]
    start, drawn = phases.start, np.ones(len(prediction.time), bool)
    if held := phases.of_string(string):  # for a measured speed, it holds while that is held
        start = held.contact - prediction.choirs[string - 1].contact
        drawn = prediction.near_pluck(BESIDE, string)
    model, deflection = (prediction.time[drawn] + start) * 1e3, prediction.deflection[drawn] * 1e3
    top.plot(model, deflection, color=PREDICTED, ls="--", label="predicted")
    top.set_ylabel("deflection at the laser (mm)")
    top.legend(loc="lower right")
    below.plot(model, prediction.finger_force[drawn], color=PREDICTED, ls="--")
    below.set(ylabel="finger force (N)", xlabel="time after the trigger (ms)")
    end = phases.bottom * 1e3
    below.set_xlim(0, end)
    scale_to_pluck(below, press, phases, prediction.peak_force)
    shade_phases(below, phases, 0.0)
    shade_phases(top, phases, 0.0, named=True)


def _force_on_deflection(axes, sets: Sequence[_Set], prediction: Prediction, string: int) -> None:
    for (presses, phases), colour, of_set in zip(sets, COLOURS, _names(sets), strict=False):
        label = f"{of_set}{_label(presses[0])}, {counted(len(presses), 'press')}"
        for press, found in zip(presses, phases, strict=True):
            if found.of_string(string):
                _pluck(axes, press, found, string, color=colour, label=label)
                label = None
    deflection, force = prediction.from_contact(BESIDE, string)
    label = f"predicted ({prediction.level})"
    axes.plot(deflection * 1e3, force, color=PREDICTED, ls="--", lw=2, label=label)
    which = f" with string {string}" * (len(prediction.choirs) > 1)
    below = f"deflection at the laser from contact{which} (mm)"
    unseen = any(f.unseen_force is not None for _, phases in sets for f in phases)
    axes.set(xlabel=below, ylabel=f"finger force (N){'; recorded: above that at rest' * unseen}")
    axes.legend(loc="upper left")


def _pluck(axes: Axes, press: Press, found: Phases, string: int, **style: Any) -> None:
    """Draw the force over the deflection from contact of a string to its release."""
    if held := found.of_string(string):
        end = min(held.release + BESIDE, found.bottom)
        deflection, force = press.from_contact(held.contact, held.contact - BESIDE, end)
        axes.plot(deflection * 1e3, force, lw=0.7, alpha=0.7, **style)


def _budget(figure: FigureBase, place: SubplotSpec, found: Comparison) -> bool:
    """Draw what each input contributes to the variances; return whether the rig states ranges."""
    shown = listed_contributions(found)
    if not shown:
        return False
    axes = figure.add_subplot(place)
    for number, (name, colour) in enumerate(zip(ERRORS, SERIES, strict=False)):
        at = [k + (number - 1) * BAR for k in range(len(shown))]
        values = [100 * each.fractions[name] for each in shown]
        axes.barh(at, values, BAR, color=colour, label=QUANTITIES[name].label)
    axes.set_yticks(range(len(shown)), [each.name for each in shown], fontsize=8)
    axes.invert_yaxis()
    axes.set_xlabel("part of the variance of the model error (%)")
    axes.legend(fontsize=8)
    return True


def _names(sets: Sequence[_Set]) -> tuple[str, ...]:
    return ("first set: ", "second set: ") if len(sets) > 1 else ("",)


def _label(press: Press) -> str:
    return "simulated" if press.simulated else "measured"
