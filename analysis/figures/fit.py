"""The plot of a fit: measured force, model, residuals and the correlation of parameters."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter

from sautereau.analysis.figures.made import how_made, stamp
from sautereau.analysis.figures.palette import BEFORE, DASHES, MEASURED, OTHER, PREDICTED, SERIES
from sautereau.analysis.identify.fit import Fit
from sautereau.analysis.identify.identified import Estimate, Identified
from sautereau.analysis.identify.information import IDENTIFIABLE
from sautereau.analysis.identify.parameters import values_of_rig
from sautereau.analysis.text import counted, in_rig_units

AFTER = 1.7  # The force is drawn to this multiple of the time to its largest value


def fit_figure(fitted: Fit, found: Identified, simulated: bool) -> Figure:
    """Return a figure of the first press's force, the residuals of all, and the correlation."""
    figure = Figure(figsize=(12, 6.5), layout="constrained")
    several = len(found.estimates) > 1
    grid = figure.add_gridspec(2, 1 + several, width_ratios=(1.6, 1)[: 1 + several])
    top = figure.add_subplot(grid[0, 0])
    below = figure.add_subplot(grid[1, 0])
    _forces(top, below, fitted)
    if several:
        _correlation(figure, figure.add_subplot(grid[0, 1]), found)
        _combinations(figure.add_subplot(grid[1, 1]), found)
    else:
        top.set_title(_value(found.estimates[0]), fontsize=10)
    kind = how_made(simulated)
    figure.suptitle(
        f"Rig {found.rig.name}: fit to {counted(len(found.presses), 'press')}, {kind};"
        f" RMS force residual {found.residual_before * 1e3:.3g} mN before,"
        f" {found.residual * 1e3:.3g} mN after"
    )
    stamp(figure, simulated)
    return figure


def _forces(top, below, fitted: Fit) -> None:
    """Draw the first press's force and its models, and the residual of every press."""
    dynamics, noise = fitted.problem.dynamics, fitted.problem.whitenings
    before, _ = dynamics.residuals(values_of_rig(dynamics.rig, dynamics.free))
    after, _ = dynamics.residuals(fitted.values)
    press = dynamics.presses[0]
    time = press.time * 1e3
    force = np.full(len(time), np.nan)
    force[press.used] = press.force()[press.used]
    top.plot(time, force, color=MEASURED, lw=2.2, alpha=0.6, label="recorded")
    for residual, colour, name, dashes in (
        (before[0], BEFORE, "model before", ":"),
        (after[0], PREDICTED, "model fitted", "--"),
    ):
        model = np.full(len(time), np.nan)
        model[press.used] = force[press.used] - residual + noise[0].trend(residual)
        top.plot(time, model, color=colour, lw=1.4, ls=dashes, label=name)
    start, peak = time[press.used][0], time[np.nanargmax(force)]
    top.set_xlim(start, start + AFTER * (peak - start))
    top.set(ylabel="finger force (N)", xlabel="time after the trigger (ms), first press")
    top.legend(loc="upper right")
    for i, (each, residual, white) in enumerate(zip(dynamics.presses, after, noise, strict=True)):
        left = np.full(len(each.time), np.nan)
        left[each.used] = residual - white.trend(residual)
        style = {"color": SERIES[i % len(SERIES)], "ls": DASHES[i % len(DASHES)]}
        below.plot(each.time * 1e3, left * 1e3, lw=0.6, alpha=0.7, **style)
    below.set(ylabel="force residual of every press (mN)", xlabel="time after the trigger (ms)")


def _value(one: Estimate) -> str:
    value, (spread,), unit = in_rig_units(one.value, one.std, one.unit, [one.std])
    return f"{one.name}: {value} ± {spread} {unit}".strip()


def _correlation(figure, axes, found: Identified) -> None:
    names = [e.name.rpartition(".")[2] for e in found.estimates]
    image = axes.imshow(found.correlation, cmap="RdBu_r", vmin=-1, vmax=1, aspect="auto")
    axes.set_xticks(range(len(names)), names, rotation=30, ha="right")
    axes.set_yticks(range(len(names)), names)
    for (row, column), value in np.ndenumerate(found.correlation):
        colour = "white" if abs(value) > 0.6 else "black"
        axes.text(column, row, f"{value:.2f}", ha="center", va="center", color=colour)
    figure.colorbar(image, ax=axes, label="correlation")


def _combinations(axes, found: Identified) -> None:
    """Draw the uncertainty of each combination, the largest at the bottom."""
    known = [(str(c), c.std, c.identifiable) for c in found.combinations if c.std is not None]
    for place, (_, std, identifiable) in enumerate(known):
        marker, colour = ("o", MEASURED) if identifiable else ("x", PREDICTED)
        axes.plot(100 * std, -place, marker, color=colour)
    axes.axvline(100 * IDENTIFIABLE, color=OTHER, ls=":", label="identifiable below")
    axes.legend(fontsize=8)
    axes.set_yticks([-place for place in range(len(known))], [name for name, *_ in known])
    axes.tick_params(axis="y", labelsize=7)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(LogFormatter())  # where less than a decade is shown
    axes.set_xlabel("total standard uncertainty (% of the scale)")
    unseen = [str(c) for c in found.combinations if c.std is None]
    if unseen:
        axes.set_title("undetermined: " + "; ".join(unseen), fontsize=8)
