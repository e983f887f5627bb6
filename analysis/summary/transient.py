"""The oscillations of presses and their sources, as JSON and as text."""

import cmath
from collections.abc import Sequence
from typing import Any

from sautereau.analysis.summary.text import SOME_SIMULATED, counted, grouped, part_of, table
from sautereau.analysis.transient import Attributed, Examined, ObservedMode, Oscillation

_MODE = ("frequency", "frequency_std", "damping", "damping_std")
INTERVAL = 1.96  # Half width of a 95 % interval, in standard uncertainties
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
    channels, amplitudes = (
        {},
        zip(mode.amplitude.tolist(), mode.amplitude_std.tolist(), strict=True),
    )
    for name, (value, std) in zip(("force", "velocity"), amplitudes, strict=True):
        size, phase = cmath.polar(value)
        channels[name] = {
            "amplitude": size,
            "amplitude_std": std,
            "phase": phase,
            "phase_std": min(std / size, cmath.pi) if size else cmath.pi,
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
        " the start of the clearest phase:"
    )
    if found:
        heads = [
            ("frequency", "damping", "force", "velocity", ""),
            ("(Hz)", "(%)", "(mN)", "(mm/s)", "source"),
        ]
        lines += table([*heads, *map(_cells, found)], left=[4])
    for each in found:
        o = each.oscillation
        phases = [phase for phase, fraction in o.seen.items() if fraction >= 0.5]
        lines.append(f"{o.frequency:.4g} Hz: seen in {_phases(phases)}")
        if each.deciding:
            lines.append(f"{o.frequency:.4g} Hz: {UNDECIDED}; to decide it: {each.deciding}")
        if meaning := _damping(o)[1]:
            lines.append(f"{o.frequency:.4g} Hz: {meaning}")
        if not o.consistent:
            lines.append(
                f"{o.frequency:.4g} Hz: the frequencies of its phases and presses differ by more"
                " than their uncertainties"
            )
    notes = [(press.path, note) for press in examined for note in press.notes]
    return [*lines, *grouped(notes, "press")]


def _phases(names: Sequence[str]) -> str:
    if not names:
        return "none of the phases in half of the presses or more"
    return f"the phase{'s' * (len(names) > 1)} {', '.join(names)}"


def _cells(each: Attributed) -> tuple[str, ...]:
    """Return frequency, damping, both amplitudes and the source, for the table."""
    o, mode = each.oscillation, each.oscillation.clearest.mode
    force, velocity = (abs(complex(a)) * 1e3 for a in mode.amplitude)
    likely = max(each.probability, key=lambda source: each.probability[source])
    chance = f"{100 * each.probability[likely]:.0f} %"
    verdict = f"{likely} ({chance})" if each.source else f"undecided, {likely} {chance}"
    frequency = _with_std(o.frequency, o.frequency_std)
    return frequency, _damping(o)[0], f"{force:.3g}", f"{velocity:.3g}", verdict


def _damping(o: Oscillation) -> tuple[str, str]:
    """Return the damping in per cent, and what a negative estimate means."""
    limit, found = INTERVAL * o.damping_std, _with_std(100 * o.damping, 100 * o.damping_std)
    if o.damping >= 0:
        return found, ""
    if o.damping + limit >= 0:
        return f"< {100 * limit:.1f}", f"not damped measurably (estimate {found} %)"
    return "grows", f"it grows (damping {found} %): it is driven, or a beat of two oscillations"


def _with_std(value: float, std: float) -> str:
    """Return a value and its uncertainty with as many decimals as that has."""
    decimals = 2 if std < 0.1 else 1 if std < 10 else 0
    return f"{value:.{decimals}f} +- {std:.{decimals}f}"
