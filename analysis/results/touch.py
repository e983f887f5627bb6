"""The touch of a campaign's plectra, and how musicians judge it."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from sautereau.analysis.campaign.judged import Association, Judged
from sautereau.analysis.campaign.labels import LEVELS
from sautereau.analysis.campaign.touch import FELT, Felt, Plectrum, Touch
from sautereau.analysis.results.result import Result, frame_of, shown
from sautereau.analysis.session.repeatability import Spread, interval
from sautereau.analysis.text import SOME_SIMULATED, counted, table
from sautereau.rig.quantities import QUANTITIES

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


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
            f" {counted(len(found.plectra), 'plectrum')}; 95 % intervals in brackets"
        )
        for name, felt in found.felt.items():
            quantity = QUANTITIES[name]
            scale, unit = quantity.displayed
            heads = ("plectrum", "tip (N/m)", "presses", quantity.title(unit))
            cells = [_cells(plectrum, name, scale) for plectrum in found.plectra]
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
        """Return a figure of the quantities over the stiffness of the plectra."""
        from sautereau.analysis.figures.touch import touch_figure

        return shown(touch_figure(self.found))


def _units(names: Iterable[str]) -> dict[str, str]:
    return {name: QUANTITIES[name].unit for name in names}


def _cells(plectrum: Plectrum, name: str, scale: float) -> tuple[str, ...]:
    """Return a plectrum, its stiffness and presses, and one quantity with its interval."""
    stiffness, value = f"{plectrum.tip_stiffness:.4g}", interval(plectrum.felt.get(name), scale)
    return plectrum.name, stiffness, str(plectrum.presses), value


def _felt_lines(felt: Felt) -> list[str]:
    lines = [
        f"  {QUANTITIES[f'felt.{source}'].label:36}{_percent(spread)}"
        for source in ("press", "session", "plectrum", "unexplained")
        if (spread := getattr(felt, source)) is not None
    ]
    for name, exponent in felt.exponents.items():
        lines.append(
            f"  proportional to {name.removeprefix('plectrum_')}^{exponent.value:.2f}"
            f" ({exponent.low:.2f} to {exponent.high:.2f})"
        )
    return lines


def _percent(spread: Spread) -> str:
    return f"{100 * spread.value:.3f} % ({100 * spread.low:.3f} % to {100 * spread.high:.3f} %)"


def judged_lines(found: Judged) -> list[str]:
    """Return the judgements and their associations as text."""
    counts = ", ".join(f"{count} {level}" for level, count in found.judgements.items())
    lines = [f"Touch as judged: {counts}; 95 % intervals in brackets:"]
    if found.quantities:
        means = [_mean_cells(name, one) for name, one in found.quantities.items()]
        lines += table([("mean", *LEVELS), *means])
        somers_d, q_value = (QUANTITIES[f"judged.{name}"].label for name in ("somers_d", "q_value"))
        heads = [
            ("", "", "odds ratio", q_value.rpartition(" ")[0]),
            ("association", somers_d, "per std", q_value.rpartition(" ")[2]),
        ]
        rows = [_association_cells(name, one) for name, one in found.quantities.items()]
        lines += table([*heads, *rows])
    return [*lines, *(f"note: {note}" for note in found.notes)]


def _mean_cells(name: str, one: Association) -> tuple[str, ...]:
    """Return a quantity with its unit, and its mean of each level."""
    scale, unit = QUANTITIES[name].displayed
    means = (f"{scale * one.means[k]:.4g}" if k in one.means else "-" for k in LEVELS)
    return QUANTITIES[name].title(unit), *means


def _association_cells(name: str, one: Association) -> tuple[str, ...]:
    """Return a quantity, its association with the judgements, and the false discovery rate."""
    odds = "no overlap" if one.separated else interval(one.odds_ratio, digits=2)
    return QUANTITIES[name].label, interval(one.somers_d, digits=2), odds, f"{one.q_value:.2g}"
