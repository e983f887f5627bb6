"""The touch of a campaign's plectra, and how musicians judge it."""

import textwrap
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from sautereau.analysis.campaign.judged import Judged
from sautereau.analysis.campaign.row import LEVELS
from sautereau.analysis.campaign.touch import FELT, Felt, Touch
from sautereau.analysis.figures.palette import GRID, MARKERS, SERIES
from sautereau.analysis.results.result import Result, drawing, frame_of, shown
from sautereau.analysis.session.repeatability import Spread, interval
from sautereau.analysis.text import OF_DIFFERENCES, SOME_SIMULATED, counted, table
from sautereau.rig.quantities import QUANTITIES

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


STYLES = {
    name: {"color": colour, "fmt": marker, "ms": 5, "capsize": 3}
    for name, colour, marker in zip(
        ("release_force", "force_slope", "force_drop"), SERIES, MARKERS, strict=False
    )
}
"""Styles of values with error bars."""
SOURCES = ("press", "session", "plectrum", "unexplained")
"""Standard deviations of `sautereau.analysis.campaign.touch.Felt`."""


@dataclass(frozen=True, repr=False)
class JudgedTouch(Result):
    """The touch of plectra, with the judgements of musicians."""

    found: Touch
    judged: Judged | None = None
    """None without judgements."""

    def __repr__(self) -> str:
        return f"<Touch of {counted(len(self.found.plectra), 'plectrum')}>"

    @property
    def document(self) -> dict[str, Any]:
        """The touch, the judgements and their associations as JSON; SI units."""
        judged = self.judged and asdict(self.judged) | {"units": _units(self.judged.quantities)}
        return asdict(self.found) | {"units": _units(FELT), "judged": judged}

    def lines(self) -> list[str]:
        """Return the touch as text: of each quantity a table of the plectra, and its spread."""
        found, lines = self.found, []
        if found.simulated:
            lines.append(SOME_SIMULATED)
        lines.append(
            f"{counted(found.presses, 'press')}, {counted(found.sessions, 'session')},"
            f" {counted(len(found.plectra), 'plectrum')}"
        )
        lines.append(f"in brackets {OF_DIFFERENCES}")
        for name, felt in found.felt.items():
            quantity = QUANTITIES[name]
            scale, _ = quantity.displayed
            heads = ("plectrum", "tip (N/m)", "presses", quantity.title)
            cells = [
                (
                    p.name,
                    f"{p.tip_stiffness:.4g}",
                    str(p.presses),
                    interval(p.felt.get(name), scale),
                )
                for p in found.plectra
            ]
            lines += table([heads, *cells], left=(0, 3))
            label = f"{quantity.label}, {counted(felt.presses, 'press')}"
            lines += [f"{label}, standard deviations:", *_felt_lines(felt)]
        if found.hardness:
            names = (f"{level}: {', '.join(own)}" for level, own in found.hardness.items())
            by = QUANTITIES[next(iter(found.felt))].label
            lines += [
                f"thirds of the plectra by their {by}, softest first:",
                *(f"  {n}" for n in names),
            ]
        lines += [f"note: {note}" for note in found.notes]
        return [*lines, *(judged_lines(self.judged) if self.judged else ())]

    def to_frame(self) -> "pd.DataFrame":
        """Return each quantity of each plectrum, with its 95 % interval."""
        rows = [
            (plectrum.name, name, one.value, one.low, one.high, plectrum.presses)
            for plectrum in self.found.plectra
            for name, one in plectrum.felt.items()
        ]
        columns = ("plectrum", "name", "value", "low", "high", "presses")
        return frame_of(rows, columns, ["plectrum", "name"], _units(FELT))

    def plot(self) -> "Figure":
        """Return a figure: each quantity over the tip's stiffness, and all standard deviations."""
        figure, found = drawing(13, 7.5), self.found
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
            f" bars: {OF_DIFFERENCES}"
        )
        return shown(figure)


def _units(names: Iterable[str]) -> dict[str, str]:
    return {name: QUANTITIES[name].unit for name in names}


def _felt_lines(felt: Felt) -> list[str]:
    lines = []
    for source in SOURCES:
        if (spread := getattr(felt, source)) is not None:
            value, low, high = (f"{100 * x:.3f} %" for x in (spread.value, spread.low, spread.high))
            label = QUANTITIES[f"felt.{source}"].label
            lines.append(f"  {label:36}{value} ({low} to {high})")
    for name, exponent in felt.exponents.items():
        lines.append(
            f"  proportional to {name.removeprefix('plectrum_')}^{exponent.value:.2f}"
            f" ({exponent.low:.2f} to {exponent.high:.2f})"
        )
    return lines


def judged_lines(found: Judged) -> list[str]:
    """Return the judgements and their associations as text."""
    counts = ", ".join(f"{count} {level}" for level, count in found.judgements.items())
    lines = [f"Touch as judged: {counts}; 95 % intervals in brackets:"]
    if found.quantities:
        means, rows = [], []
        for name, one in found.quantities.items():
            scale, _ = QUANTITIES[name].displayed
            own = (f"{scale * one.means[k]:.4g}" if k in one.means else "-" for k in LEVELS)
            means.append((QUANTITIES[name].title, *own))
            odds = "no overlap" if one.separated else interval(one.odds_ratio, digits=2)
            association = interval(one.somers_d, digits=2)
            rows.append((QUANTITIES[name].label, association, odds, f"{one.q_value:.2g}"))
        lines += table([("mean", *LEVELS), *means])
        somers_d, q_value = (QUANTITIES[f"judged.{name}"].label for name in ("somers_d", "q_value"))
        heads = [
            ("", "", "odds ratio", q_value.rpartition(" ")[0]),
            ("association", somers_d, "per std", q_value.rpartition(" ")[2]),
        ]
        lines += table([*heads, *rows])
    return [*lines, *(f"note: {note}" for note in found.notes)]


def _felt_over_stiffness(axes: "Axes", found: Touch, name: str, felt: Felt) -> None:
    scale, _ = QUANTITIES[name].displayed
    with_it = [plectrum for plectrum in found.plectra if name in plectrum.felt]
    stiffness = [plectrum.tip_stiffness for plectrum in with_it]
    spreads = [plectrum.felt[name] for plectrum in with_it]
    forces = [scale * spread.value for spread in spreads]
    axes.errorbar(stiffness, forces, _bars(spreads, scale), **STYLES[name])
    axes.set_ylabel(QUANTITIES[name].title)
    axes.set_xlabel("plectrum stiffness at the tip (N/m)")
    exponents = ", ".join(
        f"{column.removeprefix('plectrum_')}^{e.value:.2f} ({e.low:.2f} to {e.high:.2f})"
        for column, e in felt.exponents.items()
    )
    title = QUANTITIES[name].label + (f", proportional to {exponents}" if exponents else "")
    axes.set_title(textwrap.fill(title, 60), fontsize=10)  # in a font of fixed width as well


def _sources(axes: "Axes", found: Touch) -> None:
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
