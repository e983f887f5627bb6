"""The phases of a press as JSON and as text."""

from dataclasses import asdict
from typing import Any

from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases

HEADER = (
    "Contact and release: time after the trigger.\n"
    f"{'':<13} {'jack speed':>10}  contact  release pluck duration\n"
    f"{'press':<15} {'(m/s)':>8} {'(ms)':>8} {'(ms)':>8} {'(ms)':>8} release force (N)"
)
"""Of the rows, which fit into 80 columns."""


def press_summary(press: Press, phases: Phases) -> dict[str, Any]:
    """Return one press as JSON; SI units, None where there is no pluck."""
    first = phases.plucks[0] if phases.plucks else None
    return {
        "path": str(press.path),
        "simulated": press.simulated,
        "motion": press.motion
        and {"start": press.motion.time, "std": press.motion.std, "by": press.motion.text},
        "start": phases.start,
        "contact": first and first.contact,
        "release": first and first.release,
        "bottom": phases.bottom,
        "bottomed": phases.bottomed,
        "returned": phases.returned,
        "plucks": [
            asdict(pluck) | {"pluck_duration": pluck.pluck_duration} for pluck in phases.plucks
        ],
        "missed": [list(stretch) for stretch in phases.missed],
        "speeds": {
            "free": phases.free_speed,
            "held": phases.held_speed,
            "released": phases.released_speed,
        },
        "forces": {
            "contact": first and first.contact_force,
            "release": first and first.release_force,
            "drop": first and first.force_drop,
            "peak": phases.peak_force,
        },
        "fit": phases.fit and asdict(phases.fit) | {"verdict": phases.fit.verdict},
        "warnings": [*press.warnings, *phases.warnings],
    }


def press_line(press: Press, phases: Phases) -> str:
    """Return one press as rows under `HEADER`, one for each pluck."""
    row = f"{press.path.name:<15} {phases.free_speed:>8.5f}"
    if not phases.plucks:
        row = f"{row}  no pluck"
    for number, held in enumerate(phases.plucks):
        row += "" if number == 0 else f"\n{'':<24}"
        row += (
            f" {held.contact * 1e3:>8.3f} {held.release * 1e3:>8.3f}"
            f" {held.pluck_duration * 1e3:>8.3f} {held.release_force:>17.4f}"
        )
    set_by_hand = phases.fit is not None and phases.fit.model == "by hand"
    return row + "  by hand" * set_by_hand + "  simulated" * press.simulated
