"""What was found, as plain values for machines and as lines of text for people."""

from typing import Any

from sautereau.analysis.phases import Phases
from sautereau.analysis.press.load import Press

HEADER = (
    f"{'press':<25} {'jack m/s':>9} {'contact ms':>10} {'release ms':>10}"
    f" {'held ms':>8} {'peak N':>7}"
)
"""Of the rows; they fit into 80 columns with the word simulated."""


def press_summary(press: Press, phases: Phases) -> dict[str, Any]:
    """Return one press as JSON would hold it; SI units, None where there is no pluck."""
    first = phases.plucks[0] if phases.plucks else None
    return {
        "path": str(press.path),
        "simulated": press.simulated,
        "start": phases.start,
        "contact": first and first.contact,
        "release": first and first.release,
        "bottom": phases.bottom,
        "bottomed": phases.bottomed,
        "returned": phases.returned,
        "plucks": [vars(pluck) for pluck in phases.plucks],
        "speeds": {
            "free": phases.free_speed,
            "held": phases.held_speed,
            "released": phases.released_speed,
        },
        "forces": {
            "contact": first and first.contact_force,
            "peak": first and first.release_force,
            "step": first and first.force_drop,
        },
        "warnings": [*press.warnings, *phases.warnings],
    }


def press_line(press: Press, phases: Phases) -> str:
    """Return one press as rows under `HEADER`, one a pluck."""
    name = press.path.name + (" simulated" if press.simulated else "")
    row = f"{name:<25} {phases.free_speed:>9.5f}"
    if not phases.plucks:
        return f"{row}  no pluck"
    first, *more = (
        f"{p.contact * 1e3:>10.3f} {p.release * 1e3:>10.3f}"
        f" {p.duration * 1e3:>8.3f} {p.release_force:>7.4f}"
        for p in phases.plucks
    )
    return "\n".join([f"{row} {first}", *(f"{'':<35} {line}" for line in more)])
