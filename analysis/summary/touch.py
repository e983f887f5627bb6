"""The touch of a campaign's plectra, as JSON and as text."""

from dataclasses import asdict
from typing import Any

from sautereau.analysis.campaign.touch import FELT, Felt, Plectrum, Touch
from sautereau.analysis.session.repeatability import Spread
from sautereau.analysis.summary.text import SOME_SIMULATED, counted, table
from sautereau.rig.quantities import QUANTITIES


def touch_summary(found: Touch) -> dict[str, Any]:
    """Return the touch as JSON; SI units."""
    return asdict(found) | {"units": {name: QUANTITIES[name].unit for name in FELT}}


def touch_lines(found: Touch) -> list[str]:
    """Return the touch as text: of each quantity a table of the plectra, and its spread."""
    lines = []
    if found.simulated:
        lines.append(SOME_SIMULATED)
    lines.append(
        f"{counted(found.presses, 'press')}, {counted(found.sessions, 'session')},"
        f" {counted(len(found.plectra), 'plectrum')}; 95 % intervals in brackets"
    )
    for name, felt in found.felt.items():
        quantity = QUANTITIES[name]
        scale, unit = quantity.displayed
        heads = ("plectrum", "3EI/L^3 (N/m)", "presses", quantity.title(unit))
        cells = [_cells(plectrum, name, scale) for plectrum in found.plectra]
        lines += table([heads, *cells], left=(0, 3))
        label = f"{quantity.label}, {counted(felt.presses, 'press')}"
        lines += [f"{label}, standard deviations:", *_felt_lines(felt)]
    return [*lines, *(f"note: {note}" for note in found.notes)]


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


def interval(spread: Spread | None, scale: float = 1.0, digits: int = 4) -> str:
    """Return a figure with its interval: `0.34 (0.3 to 0.38)`; `-` for None."""
    if spread is None:
        return "-"
    value, low, high = (f"{scale * v:.{digits}g}" for v in (spread.value, spread.low, spread.high))
    return f"{value} ({low} to {high})"


def _percent(spread: Spread) -> str:
    return f"{100 * spread.value:.3f} % ({100 * spread.low:.3f} % to {100 * spread.high:.3f} %)"
