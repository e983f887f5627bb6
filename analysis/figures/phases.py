"""The plot of presses and their phases: signals, boundaries and their uncertainty."""

from collections.abc import Sequence
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.figures.palette import (
    CONTACT,
    DOUBTFUL,
    HATCH,
    MEASURED,
    OTHER,
    PHASES,
    RELEASE,
    SERIES,
    SEVERAL,
    how_made,
)
from sautereau.analysis.loading.press import Press
from sautereau.analysis.model.choirs import string_names
from sautereau.analysis.phases import Phases
from sautereau.analysis.phases.found import pluck_names, stretches
from sautereau.analysis.session.repeatability import NORMAL
from sautereau.rig.quantities import QUANTITIES


def shade_phases(axes: Axes, found: Phases, start: float, *, named: bool = False) -> None:
    """Shade the phases of a press, and name them above the upper edge of the axes.

    Args:
        axes: Of a time in ms.
        start: ms, start of the first phase.
    """
    held = [(pluck.contact * 1e3, pluck.release * 1e3) for pluck in found.plucks]
    every = stretches(held, start, found.bottom * 1e3)
    for number, (begin, stop, name) in enumerate(every):
        colour, hatch = PHASES.get(name, SEVERAL)
        axes.axvspan(begin, stop, facecolor=colour, edgecolor=HATCH, hatch=hatch, lw=0, zorder=0)
        if begin > start:
            axes.axvline(begin, color=OTHER, lw=0.6, zorder=0.5)
        if named:
            # Several strings make short phases, whose names are in turn on three lines.
            place = ((begin + stop) / 2, 1.01 + 0.07 * (number % 3) * (len(every) > 3))
            axes.text(*place, name, transform=axes.get_xaxis_transform(), ha="center", va="bottom")


def scale_to_pluck(axes: Axes, press: Press, found: Phases, highest: float = 0.0) -> None:
    """Scale the force to that from first contact on; say where the finger's impact is beyond it.

    Args:
        axes: Force [N] over time [ms].
        found: Its phases; without a pluck, all forces until the lowest key are in range.
        highest: N, of another curve in the axes.
    """
    time, force = press.time, press.samples["force"]
    first = min((held.contact for held in found.plucks), default=found.start)
    before, seen = (time < first) & (time <= found.bottom), (time >= first) & (time <= found.bottom)
    if not seen.any():
        return
    low, high = min(0.0, float(force[seen].min())), max(highest, float(force[seen].max()))
    margin = 0.05 + 0.12 * (high - low)
    axes.set_ylim(low - margin, high + margin)
    if before.any() and force[before].max() > high + margin:
        at = np.flatnonzero(before)[np.argmax(force[before])]
        text = f"peak {force[at]:.2g} N"
        place = (time[at] * 1e3, high + margin)
        axes.annotate(text, place, (4, -6), textcoords="offset points", va="top")


MOST = 8  # Maximum number of presses in one plot
LABEL = 46  # Characters in a line of a legend


def phases_figure(presses: Sequence[Press], phases: Sequence[Phases]) -> Figure:
    """Return a figure with a row per press: force and jack speed over time, contact and release.

    A boundary is a line with a band of 95 %; doubtful intervals are shaded, as is where the load
    climbs and collapses without a pluck.

    Raises:
        AnalysisError: There is no press to draw, or too many for one plot.
    """
    if not presses:
        raise AnalysisError("there is no press to draw; give at least one recording")
    if len(presses) > MOST:
        raise AnalysisError(
            f"{len(presses)} presses are too many for one plot of at most {MOST}; give fewer"
            " recordings, or omit the plot"
        )
    figure = Figure(figsize=(12, 1.2 + 3.2 * len(presses)), layout="constrained")
    grid = figure.subplots(len(presses), 2, squeeze=False, width_ratios=(2, 1))
    folders, rigs = (
        {press.path.parent for press in presses},
        dict.fromkeys(p.rig.name for p in presses),
    )
    for (complete, close), press, found in zip(grid, presses, phases, strict=True):
        folder = f"{press.path.parent.name}/" * (len(folders) > 1)
        _complete(complete, press, found, f"{folder}{press.path.name}")
        _close(close, press, found)
    kind = how_made(any(press.simulated for press in presses))
    figure.suptitle(f"Rig {' and '.join(rigs)}: phases, {kind}")
    return figure


def _complete(axes: Axes, press: Press, found: Phases, shown: str) -> None:
    time = press.time * 1e3
    # Of the time from the start to the full rise.
    spare = 0.15 * max(found.bottom - found.start, 1e-3)
    inside = slice(*time.searchsorted([(found.start - spare) * 1e3, (found.bottom + spare) * 1e3]))
    if inside.stop - inside.start < 2:
        inside = slice(None)
    axes.plot(time[inside], press.samples["force"][inside], color=MEASURED, lw=1.1)
    scale_to_pluck(axes, press, found)
    if found.plucks:
        shade_phases(axes, found, found.start * 1e3)
    axes.set_ylabel("finger force (N), thick", color=MEASURED)
    axes.set_xlabel("time after the trigger (ms)")
    speed = axes.twinx()
    speed.plot(time[inside], press.samples["jack_speed"][inside], color=OTHER, lw=0.7)
    speed.set_ylabel("jack speed (m/s), thin", color=OTHER)
    for mark in press.quality_flags:
        if mark.stop * 1e3 > time[inside][0] and mark.start * 1e3 < time[inside][-1]:
            axes.axvspan(mark.start * 1e3, mark.stop * 1e3, color=DOUBTFUL, alpha=0.5, zorder=0.4)
    for start, stop in found.missed:
        label = f"load without a pluck: {start * 1e3:.4g} to {stop * 1e3:.4g} ms"
        style = {"facecolor": DOUBTFUL, "edgecolor": OTHER, "hatch": "xx", "alpha": 0.4, "lw": 0}
        axes.axvspan(start * 1e3, stop * 1e3, label=label, zorder=0.4, **style)
    names = pluck_names(found.plucks, string_names(press.rig))
    for name, held in zip(names, found.plucks, strict=True):
        which = f"{name}{', doubtful' * held.doubtful}"
        _boundary(axes, held.contact, held.contact_std, CONTACT, "-", f"contact, {which}")
        _boundary(axes, held.release, held.release_std, RELEASE, "--", f"release, {which}")
    others = {name: getattr(found, name) for name in ("bottomed", "bottom", "returned")}
    for name, instant in others.items():
        if instant is not None and time[inside][0] <= instant * 1e3 <= time[inside][-1]:
            axes.axvline(instant * 1e3, color=OTHER, lw=0.8, ls=":", label=QUANTITIES[name].label)
    above = {"loc": "lower left", "bbox_to_anchor": (0, 1), "ncols": 3, "frameon": False}
    title = f"{shown}{', simulated' * press.simulated}"
    handles = axes.get_legend_handles_labels()
    speed.legend(*handles, fontsize=8, title=title, alignment="left", **above)


def _close(axes: Axes, press: Press, found: Phases) -> None:
    """Draw the force on the deflection from contact on, as the paper aligns its presses.

    A load without a pluck is drawn from its start on.
    """
    names = pluck_names(found.plucks, string_names(press.rig))
    plucks = [
        (held.contact, held.release, name, SERIES[(held.string or 0) - 1])
        for held, name in zip(found.plucks, names, strict=True)
    ]
    stretches = plucks + [(*stretch, "load without a pluck", OTHER) for stretch in found.missed]
    if not stretches:
        axes.text(0.5, 0.5, "no pluck", transform=axes.transAxes, ha="center", va="center")
        axes.set_axis_off()
        return
    for start, stop, label, colour in stretches:
        margin = 0.25 * (stop - start)
        deflection, force = press.from_contact(start, start - margin, stop + margin)
        axes.plot(deflection * 1e3, force, lw=0.7, color=colour, label=fill(label, LABEL))
    if len(stretches) > 1:
        axes.legend(fontsize=8)
    axes.axvline(0.0, color=CONTACT, lw=1)
    axes.set(xlabel="deflection at the laser from contact (mm)", ylabel="finger force (N)")


def _boundary(axes: Axes, instant: float, std: float, colour: str, dashes: str, name: str) -> None:
    half = NORMAL * std
    label = fill(f"{name}: {instant * 1e3:.3f} ± {std * 1e3:#.2g} ms", LABEL)
    axes.axvspan((instant - half) * 1e3, (instant + half) * 1e3, color=colour, alpha=0.25, lw=0)
    axes.axvline(instant * 1e3, color=colour, ls=dashes, lw=1.2, label=label)
