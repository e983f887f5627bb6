"""Plot of effects: each quantity over the levels of each factor, with all presses."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sautereau.analysis.campaign.effects import FactorEffects, FittedEffects
from sautereau.analysis.figures.palette import BEFORE, DASHES, GRID, MARKERS, MEASURED, SERIES
from sautereau.analysis.press.features import split_column, title_of
from sautereau.rig.quantities import QUANTITIES
from sautereau.trajectory.motion import Floats

WIDTH, HEIGHT = 4.2, 2.4  # Of one panel (inch)
MOST_TICKS = 6  # Levels of which each has its tick


def effects_figure(
    fitted: Mapping[str, FittedEffects],
    factors: Mapping[str, Sequence[str]],
    order: Mapping[str, Sequence[str]],
    values: Mapping[str, Floats],
    title: str,
) -> Figure:
    """Return a figure with a row for each quantity, and a column for each factor and interaction.

    In a factor's column, points are presses: the mean of their level plus their residual, without
    the effects of the other factors. That of an interaction has the mean of each combination.

    Args:
        fitted: Effects by quantity.
        factors: Level of each press by factor.
        order: Levels in their order by factor.
        values: Of each press by quantity, SI units.
    """
    count = max(len(fit.factors) for fit in fitted.values())
    size = (max(6.4, WIDTH * count), 0.8 + HEIGHT * len(fitted))
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(len(fitted), count, sharey="row", squeeze=False)
    for number, (name, fit) in enumerate(fitted.items()):
        scale, _ = QUANTITIES[split_column(name)[0]].displayed
        for axes, factor in zip(panels[number], fit.factors, strict=False):
            if factor.means:
                _levels(axes, factor, factors[factor.name], fit.residuals, scale)
            else:
                _combinations(axes, factor, factors, order, scale * values[name])
                if number == 0:
                    axes.legend(
                        title=factor.of[0], frameon=False, fontsize=7, title_fontsize=7, ncols=3,
                        loc="lower center", bbox_to_anchor=(0.5, 1.0),
                    )  # fmt: skip
            axes.grid(color=GRID, lw=0.7)
            axes.set_axisbelow(True)
        for axes in panels[number, len(fit.factors) :]:
            axes.set_axis_off()
        panels[number, 0].set_ylabel(title_of(name).replace(" (", "\n("))
    figure.suptitle(f"{title}; bars: 95 % intervals", fontsize=10)
    return figure


def _levels(
    axes: Axes, factor: FactorEffects, own: Sequence[str], residuals: Floats, scale: float
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


def _combinations(
    axes: Axes,
    factor: FactorEffects,
    factors: Mapping[str, Sequence[str]],
    order: Mapping[str, Sequence[str]],
    values: Floats,
) -> None:
    """Draw the mean of the presses of each combination, a line for each level of one factor."""
    first, second = factor.of
    levels = list(order[second])
    places = _places(axes, second, levels)
    own, other = np.asarray(factors[first]), np.asarray(factors[second])
    for number, level in enumerate(order[first]):
        means = [np.nanmean(values[(own == level) & (other == each)]) for each in levels]
        marker, colour = MARKERS[number % len(MARKERS)], SERIES[number % len(SERIES)]
        dashes = DASHES[number % len(DASHES)]
        axes.plot(places, means, marker=marker, color=colour, ls=dashes, label=level, ms=4)


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
