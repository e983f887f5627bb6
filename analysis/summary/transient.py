"""The oscillations of presses and their sources, as JSON and as text."""

import cmath
from collections.abc import Sequence
from typing import Any

from sautereau.analysis.summary.text import SOME_SIMULATED, counted, part_of
from sautereau.analysis.transient import Attributed, Examined, ObservedMode

_MODE = ("frequency", "frequency_std", "damping", "damping_std")
UNDECIDED = "source undecided by these recordings"


def transient_summary(examined: Sequence[Examined], found: Sequence[Attributed]) -> dict[str, Any]:
    """Return presses and oscillations as JSON; SI units, phases in rad."""
    return {
        "simulated": any(press.simulated for press in examined),
        "presses": [
            {"path": str(press.path), "speed": press.speed, "notes": list(press.notes)}
            for press in examined
        ],
        "oscillations": [
            {
                **part_of(each.oscillation, *_MODE, "consistent"),
                **part_of(each, "source", "probability", "deciding"),
                **part_of(each.oscillation, "seen", "presses"),
                "modes": [_mode(observed) for observed in each.oscillation.observed],
            }
            for each in found
        ],
    }


def _mode(observed: ObservedMode) -> dict[str, Any]:
    mode = observed.mode
    channels = {}
    for name, value, std in zip(
        ("force", "velocity"), mode.amplitude, mode.amplitude_std, strict=True
    ):
        size = abs(complex(value))
        channels[name] = {
            "amplitude": size,
            "amplitude_std": float(std),
            "phase": cmath.phase(complex(value)),
            "phase_std": min(float(std) / size, cmath.pi) if size else cmath.pi,
        }
    return {
        "press": observed.press,
        "phase_of_press": observed.phase,
        **part_of(mode, *_MODE),
        **channels,
        "force_over_inertia": {
            "size": abs(observed.ratio),
            "phase": cmath.phase(observed.ratio),
            "not_seen_in": observed.unseen or None,
        },
    }


def transient_lines(examined: Sequence[Examined], found: Sequence[Attributed]) -> list[str]:
    """Return the oscillations as text, a table and what would decide the undecided ones."""
    lines = [SOME_SIMULATED] if any(press.simulated for press in examined) else []
    lines.append(
        f"{counted(len(found), 'oscillation')} in {counted(len(examined), 'press')}; amplitudes at"
        " the start of the phase that shows it best:"
    )
    if found:
        lines.append(
            f"{'frequency (Hz)':>18} {'damping (%)':>14} {'force':>8} {'velocity':>10}"
            f"  {'phases':<19} source"
        )
        lines.append(f"{'':>18} {'':>14} {'(mN)':>8} {'(mm/s)':>10}")
    lines += [_line(each) for each in found]
    for each in found:
        o = each.oscillation
        if each.deciding:
            lines.append(f"{o.frequency:.4g} Hz: {UNDECIDED}; to decide it: {each.deciding}")
        if not o.consistent:
            lines.append(
                f"{o.frequency:.4g} Hz: the frequencies of its phases and presses differ by more"
                " than their uncertainties"
            )
    return [*lines, *(f"{press.path}: {note}" for press in examined for note in press.notes)]


def _line(each: Attributed) -> str:
    o, mode = each.oscillation, each.oscillation.clearest.mode
    force, velocity = (abs(complex(a)) * 1e3 for a in mode.amplitude)
    phases = ", ".join(phase for phase, fraction in o.seen.items() if fraction >= 0.5)
    likely = max(each.probability, key=lambda source: each.probability[source])
    chance = f"{100 * each.probability[likely]:.0f} %"
    verdict = f"{likely} ({chance})" if each.source else f"undecided, {likely} {chance}"
    return (
        f"{_with_std(o.frequency, o.frequency_std):>18}"
        f" {_with_std(100 * o.damping, 100 * o.damping_std):>14}"
        f" {force:8.3g} {velocity:10.3g}  {phases:<19} {verdict}"
    )


def _with_std(value: float, std: float) -> str:
    """Return a value and its uncertainty with as many decimals as that has."""
    decimals = 2 if std < 0.1 else 1 if std < 10 else 0
    return f"{value:.{decimals}f} ± {std:.{decimals}f}"
