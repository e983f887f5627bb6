"""Plot of effects: each quantity over the levels of each factor, with all presses."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sautereau.analysis.campaign.effects import FactorEffects
from sautereau.analysis.figures.palette import BEFORE, DASHES, GRID, MARKERS, MEASURED, SERIES
from sautereau.analysis.text import counted
from sautereau.trajectory.motion import Floats

if TYPE_CHECKING:
    from sautereau.analysis.results.effects import Effects

WIDTH, HEIGHT = 4.2, 2.4  # Of one panel (inch)
MOST_TICKS = 6  # Levels of which each has its tick


def effects_figure(found: "Effects") -> Figure:
    """Return a figure with a row for each quantity, and a column for each factor and interaction.

    In a factor's column, points are presses: the mean of their level plus their residual, without
    the effects of the other factors. That of an interaction has the mean of each combination.
    """
    from sautereau.analysis.results.effects import scale_of, title_of

    columns = next(iter(found.fitted.values())).factors
    size = (max(6.4, WIDTH * len(columns)), 0.8 + HEIGHT * len(found.fitted))
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(len(found.fitted), len(columns), sharey="row", squeeze=False)
    for number, (name, fit) in enumerate(found.fitted.items()):
        row = panels[number]
        values = scale_of(name) * found.values[name]
        for axes, factor in zip(row, fit.factors, strict=True):
            if factor.means:
                residuals = scale_of(name) * fit.residuals
                _levels(axes, found, factor, residuals, scale_of(name))
            else:
                _combinations(axes, found, factor.name, values, named=number == 0)
            axes.grid(color=GRID, lw=0.7)
            axes.set_axisbelow(True)
        row[0].set_ylabel(title_of(name).replace(" (", "\n("))
    blocks = counted(len(set(found.blocks.tolist())), "block")
    figure.suptitle(
        "SIMULATED: " * found.simulated
        + f"effects, {counted(len(found.blocks), 'press')} in {blocks}; bars: 95 % intervals",
        fontsize=10,
    )
    return figure


def _levels(
    axes: Axes, found: "Effects", factor: FactorEffects, residuals: Floats, scale: float
) -> None:
    """Draw the presses of each level, and its mean."""
    levels = [mean.level for mean in factor.means]
    places = _places(axes, factor.name, levels)
    means = scale * np.array([(m.value, m.value - m.low, m.high - m.value) for m in factor.means])
    number = [levels.index(level) for level in found.factors[factor.name]]
    axes.plot(places[number], means[number, 0] + residuals, ".", color=BEFORE, ms=4)
    style = {"fmt": "o", "color": MEASURED, "ms": 4, "capsize": 5}
    axes.errorbar(places, means[:, 0], means[:, 1:].T, **style)


def _combinations(axes: Axes, found: "Effects", name: str, values: Floats, *, named: bool) -> None:
    """Draw the mean of the presses of each combination, a line for each level of one factor."""
    first, second = name.split(" x ")
    levels = list(found.order[second])
    places = _places(axes, second, levels)
    own, other = np.asarray(found.factors[first]), np.asarray(found.factors[second])
    for number, level in enumerate(found.order[first]):
        means = [np.nanmean(values[(own == level) & (other == each)]) for each in levels]
        marker, colour = MARKERS[number % len(MARKERS)], SERIES[number % len(SERIES)]
        dashes = DASHES[number % len(DASHES)]
        axes.plot(places, means, marker=marker, color=colour, ls=dashes, label=level, ms=4)
    if named:
        axes.legend(
            title=first, frameon=False, fontsize=7, title_fontsize=7, ncols=3,
            loc="lower center", bbox_to_anchor=(0.5, 1.0),
        )  # fmt: skip


def _places(axes: Axes, name: str, levels: list[str]) -> Floats:
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
