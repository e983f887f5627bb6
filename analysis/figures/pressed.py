"""What the plots of a press over time share: its phases, and a force axis that shows the pluck."""

import numpy as np
from matplotlib.axes import Axes

from sautereau.analysis.figures.palette import HATCH, OTHER, PHASES, SEVERAL
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.analysis.phases.found import stretches


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
            # Several strings make short phases, whose names are in turn on two lines.
            place = ((begin + stop) / 2, 1.08 if len(every) > 3 and number % 2 else 1.01)
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
