"""The oscillations of presses and their sources."""

import cmath
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sautereau.analysis.results.result import Result, frame_of, part_of, shown
from sautereau.analysis.text import SOME_SIMULATED, counted, grouped, table
from sautereau.analysis.transient import Attributed, Examined, ObservedMode, Oscillation

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

_MODE = ("frequency", "frequency_std", "damping", "damping_std")
INTERVAL = 1.96  # Half width of a 95 % interval, in standard uncertainties
UNDECIDED = "source undecided by these recordings"


@dataclass(frozen=True, repr=False)
class Transient(Result):
    """Oscillations of presses, each with its source."""

    examined: tuple[Examined, ...]
    found: tuple[Attributed, ...]

    def __repr__(self) -> str:
        count = counted(len(self.found), "oscillation")
        return f"<Transient of {counted(len(self.examined), 'press')}: {count}>"

    @property
    def simulated(self) -> bool:
        """Whether the stand-in made any of the presses."""
        return any(press.simulated for press in self.examined)

    @property
    def document(self) -> dict[str, Any]:
        """Presses and oscillations as JSON; SI units, phases in rad."""
        return {
            "simulated": self.simulated,
            "presses": [
                {"path": str(press.path), "speed": press.speed, "notes": list(press.notes)}
                for press in self.examined
            ],
            "oscillations": [
                {
                    **part_of(each.oscillation, *_MODE, "consistent"),
                    **part_of(each, "source", "probability", "deciding"),
                    **part_of(each.oscillation, "seen", "presses"),
                    "modes": [_mode(observed) for observed in each.oscillation.observed],
                }
                for each in self.found
            ],
        }

    def lines(self) -> list[str]:
        """Return the oscillations as text, and what would decide the undecided ones."""
        lines = [SOME_SIMULATED] if self.simulated else []
        lines.append(
            f"{counted(len(self.found), 'oscillation')} in {counted(len(self.examined), 'press')};"
            " amplitudes at the start of the clearest phase:"
        )
        if self.found:
            heads = [
                ("frequency", "damping", "force", "velocity", ""),
                ("(Hz)", "(%)", "(mN)", "(mm/s)", "source"),
            ]
            lines += table([*heads, *map(_cells, self.found)], left=[4])
        for each in self.found:
            o = each.oscillation
            phases = [phase for phase, fraction in o.seen.items() if fraction >= 0.5]
            lines.append(f"{o.frequency:.4g} Hz: seen in {_phases(phases)}")
            if each.deciding:
                lines.append(f"{o.frequency:.4g} Hz: {UNDECIDED}; to decide it: {each.deciding}")
            if meaning := _damping(o)[1]:
                lines.append(f"{o.frequency:.4g} Hz: {meaning}")
            if not o.consistent:
                lines.append(
                    f"{o.frequency:.4g} Hz: the frequencies of its phases and presses differ by"
                    " more than their uncertainties"
                )
        notes = [(press.path, note) for press in self.examined for note in press.notes]
        return [*lines, *grouped(notes, "press")]

    def to_frame(self) -> "pd.DataFrame":
        """Return each oscillation with frequency, damping, their uncertainties and its source."""
        rows = [
            (number, *(getattr(each.oscillation, name) for name in _MODE), each.source)
            for number, each in enumerate(self.found, 1)
        ]
        units = {"frequency": "Hz", "frequency_std": "Hz", "damping": "1", "damping_std": "1"}
        return frame_of(rows, ("oscillation", *_MODE, "source"), "oscillation", units)

    def plot(self) -> "Figure":
        """Return a figure of the oscillations and their sources."""
        from sautereau.analysis.figures.transient import transient_figure

        return shown(transient_figure(self.examined, self.found))


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
