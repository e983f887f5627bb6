"""What a campaign says about touch, as plain values and as lines."""

from dataclasses import asdict
from typing import Any

from sautereau.analysis.campaign.touch import UNITS, Felt, Touch
from sautereau.analysis.session.repeatability import Spread
from sautereau.analysis.summary.simulated import SOME_SIMULATED

SHORT = {"threshold": "N", "slope": "N/mm", "drop": "N"}
"""Units of the table."""
SCALE = {"threshold": 1.0, "slope": 1e-3, "drop": 1.0}
"""1, of the table's units."""


def touch_summary(found: Touch) -> dict[str, Any]:
    """Return the touch as JSON would hold it; SI units."""
    return asdict(found) | {"units": UNITS}


def touch_lines(found: Touch) -> list[str]:
    """Return the touch as text: a table of the plectra, then each quantity's spread."""
    lines = []
    if found.simulated:
        lines.append(SOME_SIMULATED)
    lines.append(
        f"{found.presses} presses, {found.sessions} sessions, {len(found.plectra)} plectra;"
        " intervals are of 95 %"
    )
    head = "".join(f"{f'{name} ({SHORT[name]})':>30}" for name in found.felt)
    lines.append(f"{'plectrum':10}{'3EI/L^3 N/m':>12}{'presses':>9}{head}")
    for plectrum in found.plectra:
        cells = "".join(
            f"{_interval(spread, SCALE[name]):>30}" for name, spread in plectrum.felt.items()
        )
        lines.append(f"{plectrum.name:10}{plectrum.tip_stiffness:12.4g}{plectrum.presses:9}{cells}")
    for name, felt in found.felt.items():
        lines += [f"{name}:", *_felt_lines(felt)]
    return [*lines, *(f"note: {note}" for note in found.notes)]


def _felt_lines(felt: Felt) -> list[str]:
    spreads = (
        ("within a session", felt.press),
        ("between sessions", felt.session),
        ("between plectra", felt.plectrum),
        ("  beyond their shape", felt.unexplained),
    )
    lines = [f"  {what:22}{_percent(spread)}" for what, spread in spreads if spread is not None]
    for name, exponent in felt.exponents.items():
        lines.append(
            f"  grows as {name.removeprefix('plectrum_')}^{exponent.value:.2f}"
            f" ({exponent.low:.2f} to {exponent.high:.2f})"
        )
    return lines


def _interval(spread: Spread, scale: float) -> str:
    value, low, high = (scale * v for v in (spread.value, spread.low, spread.high))
    return f"{value:.4g} ({low:.4g} to {high:.4g})"


def _percent(spread: Spread) -> str:
    return f"{spread.value:.3%} ({spread.low:.3%} to {spread.high:.3%})"
