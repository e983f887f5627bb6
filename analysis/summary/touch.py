"""The touch of a campaign's plectra, as JSON and as text."""

from dataclasses import asdict
from typing import Any

from sautereau.analysis.campaign.touch import FELT, Felt, Touch
from sautereau.analysis.session.repeatability import Spread
from sautereau.analysis.summary.text import SOME_SIMULATED, counted, interval
from sautereau.rig.quantities import QUANTITIES


def touch_summary(found: Touch) -> dict[str, Any]:
    """Return the touch as JSON; SI units."""
    return asdict(found) | {"units": {name: QUANTITIES[name].unit for name in FELT}}


def touch_lines(found: Touch) -> list[str]:
    """Return the touch as text: a table of the plectra, then the spread of each quantity."""
    lines = []
    if found.simulated:
        lines.append(SOME_SIMULATED)
    lines.append(
        f"{counted(found.presses, 'press')}, {counted(found.sessions, 'session')},"
        f" {counted(len(found.plectra), 'plectrum')}; 95 % intervals in brackets:"
    )
    quantities = {name: QUANTITIES[name] for name in found.felt}
    titles = "".join(f"{q.title(q.displayed[1]):>30}" for q in quantities.values())
    lines.append(f"{'plectrum':10}{'3EI/L^3 N/m':>12}{'presses':>9}{titles}")
    for plectrum in found.plectra:
        cells = "".join(
            f"{interval(plectrum.felt.get(name), quantity.displayed[0]):>30}"
            for name, quantity in quantities.items()
        )
        lines.append(f"{plectrum.name:10}{plectrum.tip_stiffness:12.4g}{plectrum.presses:9}{cells}")
    for name, felt in found.felt.items():
        label = f"{quantities[name].label}, {counted(felt.presses, 'press')}"
        lines += [f"{label}, standard deviations:", *_felt_lines(felt)]
    return [*lines, *(f"note: {note}" for note in found.notes)]


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
