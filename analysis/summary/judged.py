"""Judgements of touch and their associations as JSON and as text."""

from dataclasses import asdict
from typing import Any

from sautereau.analysis.campaign.judged import Association, Judged
from sautereau.analysis.campaign.labels import LEVELS
from sautereau.analysis.summary.text import table
from sautereau.analysis.summary.touch import interval
from sautereau.rig.quantities import QUANTITIES


def judged_summary(found: Judged | None) -> dict[str, Any] | None:
    """Return the judgements and their associations as JSON; SI units; None without judgements."""
    if found is None:
        return None
    return asdict(found) | {"units": {name: QUANTITIES[name].unit for name in found.quantities}}


def judged_lines(found: Judged | None) -> list[str]:
    """Return the judgements and their associations as text; nothing without judgements."""
    if found is None:
        return []
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
