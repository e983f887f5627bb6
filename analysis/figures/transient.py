"""The plot of the transient phase: oscillations of a press, and the sources of all presses."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sautereau.analysis.figures.made import how_made
from sautereau.analysis.figures.palette import BLUE, GREEN, GRID, PURPLE, SKY, VERMILLION, YELLOW
from sautereau.analysis.transient import Attributed, Examined, Source

COLOURS = {
    Source.STRING: VERMILLION,
    Source.KEY: GREEN,
    Source.FINGER: BLUE,
    Source.TRANSDUCER: PURPLE,
    Source.MAINS: SKY,
    Source.OTHER: YELLOW,
}
HATCHES = dict(zip(COLOURS, ("", "//", "..", "xx", "--", "||"), strict=True))
"""Hatches of the bars, which then differ in grey as well."""
SIGNAL, FITTED = "#9db4c8", "#111111"
EDGE = {"edgecolor": "white", "lw": 0}
SCALES = ((1e3, "force (mN)"), (1e3, "velocity (mm/s)"))
NAMES = ("free", "held", "released")


def transient_figure(examined: Sequence[Examined], found: Sequence[Attributed]) -> Figure:
    """Return a figure: the first press without its slow part, frequencies and probabilities."""
    figure = Figure(figsize=(13, 9.5), layout="constrained")
    grid = figure.add_gridspec(3, 3, height_ratios=(1, 1, 1.2), wspace=0.06)
    for column, phase in enumerate(NAMES):
        for row in range(2):
            axes = figure.add_subplot(grid[row, column])
            _over_time(axes, examined[0], phase, row)
    _frequencies(figure.add_subplot(grid[2, :2]), found)
    _probabilities(figure.add_subplot(grid[2, 2]), found)
    kind = how_made(any(press.simulated for press in examined))
    figure.suptitle(
        f"Transient phase of {examined[0].path.name}: signals without their slow"
        f" part, and modes; {kind}"
    )
    return figure


def _over_time(axes: Axes, press: Examined, phase: str, channel: int) -> None:
    scale, label = SCALES[channel]
    stretch = next((s for s in press.stretches if s.phase == phase), None)
    if stretch is None:
        axes.text(0.5, 0.5, "not examined", transform=axes.transAxes, ha="center", va="center")
        axes.set_axis_off()
        return
    degree = np.polynomial.legendre.legvander(np.linspace(-1, 1, len(stretch.time)), 4)
    both = np.stack([stretch.signals[channel], stretch.modes.fit[channel]], axis=1)
    both = both - degree @ np.linalg.lstsq(degree, both[:, 1], rcond=None)[0][:, None]
    axes.plot(stretch.time * 1e3, both[:, 0] * scale, color=SIGNAL, lw=0.8, label="recorded")
    axes.plot(stretch.time * 1e3, both[:, 1] * scale, color=FITTED, lw=0.7, label="fitted modes")
    axes.set_ylabel(label)
    if channel == 0:
        axes.set_title(f"{phase}", fontsize=10)
    else:
        axes.set_xlabel("time after the trigger (ms)")
    if phase == "free" and channel == 0:
        axes.legend(fontsize=7, loc="upper right")
    axes.grid(color=GRID, lw=0.6)


def _frequencies(axes: Axes, found: Sequence[Attributed]) -> None:
    """Draw force amplitude over frequency; a marker per phase, a colour per source."""
    markers = {"rest": "x", "free": "s", "held": "o", "released": "^"}
    for each in found:
        colour = COLOURS[each.source] if each.source else "#000000"
        for o in each.oscillation.observed:
            force, std = abs(o.mode.amplitude[0]) * 1e3, o.mode.amplitude_std[0] * 1e3
            style = {"fmt": markers[o.phase], "color": colour, "ms": 5, "elinewidth": 0.8}
            style["mfc"] = "none" if each.source is None else colour
            axes.errorbar(o.mode.frequency, force, std, 1.96 * o.mode.frequency_std, **style)
    keys: list[Line2D | Patch] = [
        Line2D([], [], marker=marker, ls="", color="#555555", label=phase)
        for phase, marker in markers.items()
    ]
    keys += [Patch(fc=c, hatch=HATCHES[s], label=str(s), **EDGE) for s, c in COLOURS.items()]
    keys.append(Patch(fc="none", ec="black", label="undecided"))
    axes.set_yscale("log")
    axes.set_xlabel("frequency (Hz), bars: 95 %")
    axes.set_ylabel("force amplitude (mN)")
    axes.legend(handles=keys, fontsize=8, ncols=6, loc="lower center", bbox_to_anchor=(0.5, 1.06))
    axes.grid(color=GRID, lw=0.6)
    axes.set_title("modes of all presses", fontsize=10)


def _probabilities(axes: Axes, found: Sequence[Attributed]) -> None:
    left = np.zeros(len(found))
    for source, colour in COLOURS.items():
        width = np.array([each.probability[source] for each in found])
        style = {"fc": colour, "hatch": HATCHES[source], **EDGE}
        axes.barh(range(len(found)), width, left=left, height=0.7, **style)
        left = left + width
    axes.set_yticks(range(len(found)), [f"{each.oscillation.frequency:.4g} Hz" for each in found])
    axes.invert_yaxis()
    axes.set_xlim(0, 1)
    axes.set_xlabel("probability of the source")
    axes.set_title("attribution", fontsize=10)
