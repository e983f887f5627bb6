"""The phases of a press as JSON and as text."""

from dataclasses import asdict
from typing import Any

from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.analysis.press.features import NEED, gain_stds

HEADER = (
    "Contact and release: time after the trigger. !: doubtful, see the warnings.\n"
    f"{'':<13} {'jack speed':>10}        contact  release    pluck     release\n"
    f"{'':<48} duration       force\n"
    f"{'press':<15} {'(m/s)':>8} string {'(ms)':>8} {'(ms)':>8} {'(ms)':>8} {'(N)':>11}"
)
"""Head of the rows, which fit into 80 columns."""


def press_summary(press: Press, phases: Phases) -> dict[str, Any]:
    """Return one press as JSON; SI units, None where there is no pluck or a signal is missing."""
    first = phases.plucks[0] if phases.plucks else None
    unknown = NEED[press.missing] if press.missing else ()

    def known(name: str, value: Any) -> Any:
        return None if name in unknown else value

    def of_first(name: str) -> float | None:
        return known(name, getattr(first, name)) if first else None

    return {
        "path": str(press.path),
        "simulated": press.simulated,
        "motion": press.motion
        and {"start": press.motion.time, "std": press.motion.std, "by": press.motion.text},
        "start": known("start", phases.start),
        "contact": of_first("contact"),
        "release": of_first("release"),
        **{name: known(name, getattr(phases, name)) for name in ("bottom", "bottomed", "returned")},
        "plucks": [
            {name: known(name, value) for name, value in asdict(pluck).items()}
            | {"pluck_duration": pluck.pluck_duration}
            for pluck in phases.plucks
        ],
        "missed": [list(stretch) for stretch in phases.missed],
        "speeds": {
            name: known(f"{name}_speed", getattr(phases, f"{name}_speed"))
            for name in ("free", "held", "released")
        },
        "forces": {
            "contact": of_first("contact_force"),
            "release": of_first("release_force"),
            "drop": of_first("force_drop"),
            "peak": known("peak_force", phases.peak_force),
        },
        "gain_std": gain_stds(press.rig),
        "fit": phases.fit and asdict(phases.fit) | {"verdict": phases.fit.verdict},
        "warnings": [*press.warnings, *phases.warnings],
        "remarks": [*press.remarks, *phases.remarks],
    }


def press_line(press: Press, phases: Phases) -> str:
    """Return one press as rows under `HEADER`, one for each pluck; "-" for what is unknown."""
    speed = "-" if press.missing == "velocity" else f"{phases.free_speed:.5f}"
    row = f"{press.path.name:<15} {speed:>8}"
    if not phases.plucks:
        row += "  no pluck" + " !" * bool(phases.warnings)
    for number, held in enumerate(phases.plucks):
        row += "" if number == 0 else f"\n{'':<24}"
        force = "-" if press.missing == "force" else f"{held.release_force:.4f}"
        row += (
            f" {held.string or '-':>5} {held.contact * 1e3:>8.3f} {held.release * 1e3:>8.3f}"
            f" {held.pluck_duration * 1e3:>8.3f} {'!' * held.doubtful:<2}{force:>9}"
        )
    set_by_hand = phases.fit is not None and phases.fit.model == "by hand"
    alone = f"  no {press.missing}" if press.missing else ""
    return row + alone + "  by hand" * set_by_hand + "  simulated" * press.simulated
