"""Judgements of touch and their associations as JSON and as text."""

from dataclasses import asdict
from typing import Any

from sautereau.analysis.campaign.judged import Association, Judged
from sautereau.analysis.campaign.labels import LEVELS
from sautereau.analysis.summary.text import interval
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
        means = "".join(f"{level:>10}" for level in LEVELS)
        titles = f"{'odds ratio per std':>26}{QUANTITIES['judged.q_value'].label:>22}"
        lines.append(f"{'quantity':34}{means}{QUANTITIES['judged.somers_d'].label:>26}{titles}")
    lines += [_line(name, one) for name, one in found.quantities.items()]
    return [*lines, *(f"note: {note}" for note in found.notes)]


def _line(name: str, one: Association) -> str:
    quantity = QUANTITIES[name]
    scale, unit = quantity.displayed
    means = "".join(
        f"{scale * one.means[level]:>10.4g}" if level in one.means else f"{'-':>10}"
        for level in LEVELS
    )
    odds = "no overlap" if one.separated else interval(one.odds_ratio, digits=3)
    d = interval(one.somers_d, digits=3)
    return f"{quantity.title(unit):34}{means}{d:>26}{odds:>26}{one.q_value:>22.2g}"
