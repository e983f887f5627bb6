"""The phases of a press as JSON and as text."""

from dataclasses import asdict
from typing import Any

from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.analysis.phases.found import HeldString
from sautereau.analysis.press.features import (
    OF_SATURATED,
    OF_SPEED,
    Row,
    column,
    features,
    gain_stds,
    std_of,
    unknown_of,
)
from sautereau.analysis.text import concise

HEADER = (
    "Jack speed: mean and RMS error while a string is held. #: string of the rig.\n"
    "Contact and release: time after the trigger. !: doubtful, see the warnings.\n"
    "In parentheses: standard uncertainty, in units of the last digit.\n"
    "Release force: of an AC-coupled sensor counted from that at rest.\n"
    f"{'':<15} {'jack':>7} {'speed':>5} {'':>25} {'pluck':>10} {'release':>11}\n"
    f"{'':<15} {'speed':>7} {'error':>5}   {'contact':>11} {'release':>11} {'duration':>10}"
    f" {'force':>11}\n"
    f"{'press':<15} {'(m/s)':>7} {'(%)':>5} # {'(ms)':>11} {'(ms)':>11} {'(ms)':>10} {'(N)':>11}"
)  # Head of the rows, which fit into 80 columns


SHOWN = "contact", "release", "pluck_duration", "release_force"  # of a pluck in these rows


def press_summary(press: Press, phases: Phases, found: Row | None = None) -> dict[str, Any]:
    """Return one press as JSON; SI units, None where there is no pluck or a signal is missing.

    Args:
        found: Its `features`; None to compute them from the samples, which must be complete.
    """
    first = phases.plucks[0] if phases.plucks else None
    unknown = unknown_of(press, phases)

    def known(name: str, value: Any, pluck: HeldString | None = None) -> Any:
        lost = pluck and pluck.saturated and name in OF_SATURATED
        return None if name in unknown or lost else value

    def of_first(name: str) -> float | None:
        return known(name, getattr(first, name), first) if first else None

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
            {name: known(name, value, pluck) for name, value in asdict(pluck).items()}
            | {"pluck_duration": pluck.pluck_duration}
            for pluck in phases.plucks
        ],
        "missed": [list(stretch) for stretch in phases.missed],
        "speeds": {
            name: known(f"{name}_speed", getattr(phases, f"{name}_speed"))
            for name in ("free", "held", "released")
        },
        "held_speed": held_speed(press, found or features(press, phases)),
        "forces": {
            "contact": of_first("contact_force"),
            "release": of_first("release_force"),
            "drop": of_first("force_drop"),
            "peak": known("peak_force", phases.peak_force),
            "unseen": known("unseen_force", phases.unseen_force),
        },
        "gain_std": gain_stds(press.rig),
        "fit": phases.fit and asdict(phases.fit) | {"verdict": phases.fit.verdict},
        "warnings": [*press.warnings, *phases.warnings],
        "remarks": [*press.remarks, *phases.remarks],
    }


def held_speed(press: Press, found: Row) -> dict[str, Any] | None:
    """Return the jack's speed while any string is held, beside its tolerance; None if unknown."""
    mean, least, largest, error = (found[name] for name in OF_SPEED)
    tolerance = press.rig.press.speed_tolerance
    reached = error <= tolerance if isinstance(error, float) else None
    if mean is None:
        return None
    return {
        **{"mean": mean, "min": least, "max": largest, "rms_error": error},
        **{"tolerance": tolerance, "reached": reached},
    }


def press_line(press: Press, phases: Phases, found: Row | None = None) -> str:
    """Return one press as rows under `HEADER`, one for each pluck; "-" for what is unknown.

    Args:
        found: As that of `press_summary`.
    """
    found = found or features(press, phases)
    gains, speed = gain_stds(press.rig), held_speed(press, found) or {}
    mean, error = speed.get("mean"), speed.get("rms_error")
    row = f"{press.path.name:<15} {'-' if mean is None else f'{mean:.5f}':>7}"
    row += f" {'-' if error is None else f'{100 * error:.3g}':>5}"
    if not phases.plucks:
        row += "  no pluck" + " !" * bool(phases.warnings)
    for number, held in enumerate(phases.plucks):
        row += "" if number == 0 else f"\n{'':<29}"
        lost = press.missing == "force" or held.saturated
        std = {name: std_of(found, column(name, number + 1), gains) or 0.0 for name in SHOWN}
        force = "-" if lost else concise(held.release_force, std["release_force"], 4)
        contact, release, duration = (
            concise(getattr(held, name) * 1e3, std[name] * 1e3, 3) for name in SHOWN[:3]
        )
        row += f" {held.string or '-'} {contact:>11} {release:>11} {duration:>10}"
        row += f" {'!' * held.doubtful:<2}{force:>9}"
    set_by_hand = phases.fit is not None and phases.fit.model == "by hand"
    alone = f"  no {press.missing}" if press.missing else ""
    return row + alone + "  by hand" * set_by_hand + "  simulated" * press.simulated
