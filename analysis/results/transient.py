"""The oscillations of presses and their sources."""

import cmath
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sautereau.analysis.figures import palette
from sautereau.analysis.results.result import Result, drawing, frame_of, part_of, shown
from sautereau.analysis.session.repeatability import NORMAL
from sautereau.analysis.text import SOME_SIMULATED, counted, grouped, table
from sautereau.analysis.transient.attribute import Attributed, Source
from sautereau.analysis.transient.evidence import Examined, ObservedMode, Oscillation

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MODE = ("frequency", "frequency_std", "damping", "damping_std")
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
        count = f"{counted(len(self.found), 'oscillation')} in"
        lines.append(f"{count} {counted(len(self.examined), 'press')}")
        if self.found:
            lines[-1] += "; amplitudes at the start of the clearest phase:"
            heads = [
                ("frequency", "damping", "force", "velocity", ""),
                ("(Hz)", "(%)", "(mN)", "(mm/s)", "source"),
            ]
            lines += table([*heads, *map(_cells, self.found)], left=[4])
        for each in self.found:
            o = each.oscillation
            phases = [phase for phase, fraction in o.seen.items() if fraction >= 0.5]
            where = "none of the phases in half of the presses or more"
            if phases:
                where = f"the phase{'s' * (len(phases) > 1)} {', '.join(phases)}"
            lines.append(f"{o.frequency:.4g} Hz: seen in {where}")
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
        """Return a figure: the first press without its slow part, frequencies, probabilities."""
        figure = drawing(13, 9.5)
        grid = figure.add_gridspec(3, 3, height_ratios=(1, 1, 1.2), wspace=0.06)
        for column, phase in enumerate(("free", "held", "released")):
            for row in range(2):
                axes = figure.add_subplot(grid[row, column])
                _over_time(axes, self.examined[0], phase, row)
        _frequencies(figure.add_subplot(grid[2, :2]), self.found)
        _probabilities(figure.add_subplot(grid[2, 2]), self.found)
        figure.suptitle(
            f"Transient phase of {self.examined[0].path.name}: signals without their slow"
            f" part, and modes; {palette.how_made(self.simulated)}"
        )
        return shown(figure)


def _mode(observed: ObservedMode) -> dict[str, Any]:
    mode = observed.mode
    names, channels = ("force", "velocity"), {}
    amplitudes = mode.amplitude.tolist(), mode.amplitude_std.tolist()
    for name, value, std in zip(names, *amplitudes, strict=True):
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
    limit, found = NORMAL * o.damping_std, _with_std(100 * o.damping, 100 * o.damping_std)
    if o.damping >= 0:
        return found, ""
    if o.damping + limit >= 0:
        return f"< {100 * limit:.1f}", f"not damped measurably (estimate {found} %)"
    return "grows", f"it grows (damping {found} %): it is driven, or a beat of two oscillations"


def _with_std(value: float, std: float) -> str:
    """Return a value and its uncertainty with as many decimals as that has."""
    decimals = 2 if std < 0.1 else 1 if std < 10 else 0
    return f"{value:.{decimals}f} +- {std:.{decimals}f}"


COLOURS = {
    Source.STRING: palette.VERMILLION,
    Source.KEY: palette.GREEN,
    Source.FINGER: palette.BLUE,
    Source.TRANSDUCER: palette.PURPLE,
    Source.MAINS: palette.SKY,
    Source.STEADY: palette.ORANGE,
    Source.OTHER: palette.YELLOW,
}
HATCHES = dict(zip(COLOURS, ("", "//", "..", "xx", "--", "++", "||"), strict=True))
"""Hatches of the bars, which then differ in grey as well."""
SIGNAL, FITTED = "#9db4c8", "#111111"
EDGE = {"edgecolor": "white", "lw": 0}
SCALES = ((1e3, "force (mN)"), (1e3, "velocity (mm/s)"))


def _over_time(axes: "Axes", press: Examined, phase: str, channel: int) -> None:
    scale, label = SCALES[channel]
    stretch = next((s for s in press.stretches if s.phase == phase), None)
    if stretch is None:
        axes.text(0.5, 0.5, "not examined", transform=axes.transAxes, ha="center", va="center")
        axes.set_axis_off()
        return
    degree = np.polynomial.legendre.legvander(np.linspace(-1, 1, len(stretch.time)), 4)
    both = np.stack([stretch.signals[channel], stretch.modes.fit[channel]], axis=1)
    both = both - degree @ np.linalg.lstsq(degree, both[:, 1], rcond=None)[0][:, None]
    axes.plot(stretch.time * 1e3, both[:, 0] * scale, color=SIGNAL, lw=0.8, label="recorded")
    axes.plot(stretch.time * 1e3, both[:, 1] * scale, color=FITTED, lw=0.7, label="fitted modes")
    axes.set_ylabel(label)
    if channel == 0:
        axes.set_title(f"{phase}", fontsize=10)
    else:
        axes.set_xlabel("time after the trigger (ms)")
    if phase == "free" and channel == 0:
        axes.legend(fontsize=7, loc="upper right")
    axes.grid(color=palette.GRID, lw=0.6)


def _frequencies(axes: "Axes", found: Sequence[Attributed]) -> None:
    """Draw force amplitude over frequency; a marker per phase, a colour per source."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    markers = {"rest": "x", "free": "s", "held": "o", "released": "^"}
    for each in found:
        colour = COLOURS[each.source] if each.source else "#000000"
        for o in each.oscillation.observed:
            force, std = abs(o.mode.amplitude[0]) * 1e3, o.mode.amplitude_std[0] * 1e3
            style = {"fmt": markers[o.phase], "color": colour, "ms": 5, "elinewidth": 0.8}
            style["mfc"] = "none" if each.source is None else colour
            axes.errorbar(o.mode.frequency, force, std, NORMAL * o.mode.frequency_std, **style)
    keys: list[Line2D | Patch] = [
        Line2D([], [], marker=marker, ls="", color="#555555", label=phase)
        for phase, marker in markers.items()
    ]
    keys += [Patch(fc=c, hatch=HATCHES[s], label=str(s), **EDGE) for s, c in COLOURS.items()]
    keys.append(Patch(fc="none", ec="black", label="undecided"))
    axes.set_yscale("log")
    axes.set_xlabel("frequency (Hz), bars: 95 %")
    axes.set_ylabel("force amplitude (mN)")
    axes.legend(handles=keys, fontsize=8, ncols=6, loc="lower center", bbox_to_anchor=(0.5, 1.06))
    axes.grid(color=palette.GRID, lw=0.6)
    axes.set_title("modes of all presses", fontsize=10)


def _probabilities(axes: "Axes", found: Sequence[Attributed]) -> None:
    left = np.zeros(len(found))
    for source, colour in COLOURS.items():
        width = np.array([each.probability[source] for each in found])
        style = {"fc": colour, "hatch": HATCHES[source], **EDGE}
        axes.barh(range(len(found)), width, left=left, height=0.7, **style)
        left = left + width
    axes.set_yticks(range(len(found)), [f"{each.oscillation.frequency:.4g} Hz" for each in found])
    axes.invert_yaxis()
    axes.set_xlim(0, 1)
    axes.set_xlabel("probability of the source")
    axes.set_title("attribution", fontsize=10)
