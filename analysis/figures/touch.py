"""Plot of touch: forces over the plectrum's stiffness, and the sources of their spread."""

import textwrap

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sautereau.analysis.campaign.touch import Felt, Touch
from sautereau.analysis.figures.palette import GRID, MARKERS, SERIES
from sautereau.analysis.session.repeatability import Spread
from sautereau.analysis.text import counted
from sautereau.rig.quantities import QUANTITIES

STYLES = {
    name: {"color": colour, "fmt": marker, "ms": 5, "capsize": 3}
    for name, colour, marker in zip(
        ("release_force", "force_slope", "force_drop"), SERIES, MARKERS, strict=False
    )
}
"""Styles of values with error bars."""
TITLE = 60
"""Characters of a line above half of the figure, which fit in a font of fixed width as well."""
SOURCES = ("press", "session", "plectrum", "unexplained")
"""Standard deviations of `sautereau.analysis.campaign.touch.Felt`."""


def touch_figure(found: Touch) -> Figure:
    """Return a figure: each quantity over the tip's stiffness, and all standard deviations."""
    figure = Figure(figsize=(13, 7.5), layout="constrained")
    panels = figure.subplots(2, 2).ravel()
    for axes, (name, felt) in zip(panels, found.felt.items(), strict=False):
        _felt_over_stiffness(axes, found, name, felt)
    _sources(panels[3], found)
    for axes in panels:
        axes.grid(color=GRID, lw=0.7)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    figure.suptitle(
        ("SIMULATED: " if found.simulated else "")
        + f"touch of {counted(len(found.plectra), 'plectrum')} in"
        f" {counted(found.sessions, 'session')}, {counted(found.presses, 'press')};"
        " bars: 95 % intervals"
    )
    return figure


def _felt_over_stiffness(axes: Axes, found: Touch, name: str, felt: Felt) -> None:
    scale, unit = QUANTITIES[name].displayed
    with_it = [plectrum for plectrum in found.plectra if name in plectrum.felt]
    stiffness = [plectrum.tip_stiffness for plectrum in with_it]
    spreads = [plectrum.felt[name] for plectrum in with_it]
    forces = [scale * spread.value for spread in spreads]
    axes.errorbar(stiffness, forces, _bars(spreads, scale), **STYLES[name])
    axes.set_ylabel(QUANTITIES[name].title(unit))
    axes.set_xlabel("plectrum stiffness at the tip (N/m)")
    exponents = ", ".join(
        f"{column.removeprefix('plectrum_')}^{e.value:.2f} ({e.low:.2f} to {e.high:.2f})"
        for column, e in felt.exponents.items()
    )
    title = QUANTITIES[name].label + (f", proportional to {exponents}" if exponents else "")
    axes.set_title(textwrap.fill(title, TITLE), fontsize=10)


def _sources(axes: Axes, found: Touch) -> None:
    """Draw the standard deviations, one row for each source."""
    for shift, (name, felt) in enumerate(found.felt.items()):
        spreads = enumerate(getattr(felt, source) for source in SOURCES)
        rows = [(place, spread) for place, spread in spreads if spread is not None]
        deviations = [100 * spread.value for _, spread in rows]
        places = [place + 0.2 * (shift - 1) for place, _ in rows]
        bars = _bars([spread for _, spread in rows], 100.0)
        style = {"label": QUANTITIES[name].label, **STYLES[name]}
        axes.errorbar(deviations, places, xerr=bars, **style)
    labels = [QUANTITIES[f"felt.{s}"].label.replace(", ", ",\n") for s in SOURCES]
    axes.set_yticks(range(len(SOURCES)), labels)
    axes.set_ylim(len(SOURCES) - 0.5, -0.5)
    axes.set_xscale("symlog", linthresh=0.1)
    axes.set_xlim(left=0)
    axes.set_xlabel("standard deviation (%)")
    axes.set_title("sources of the spread", fontsize=10)
    axes.legend(frameon=False)


def _bars(spreads: list[Spread], scale: float) -> list[list[float]]:
    """Return the lengths of the error bars below and above the values."""
    below = [scale * (s.value - s.low) for s in spreads]
    return [below, [scale * (s.high - s.value) for s in spreads]]
