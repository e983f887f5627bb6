"""The damped modes in the phases of presses, and the oscillations of the bench that they are.

Each phase is low-passed and decimated on its own, so that contact and release have no effect. Of a
long phase only the part is used in which the modes have their largest amplitudes: the end of the
free phase, and the start of the other phases.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import median_filter
from scipy.signal import firwin
from scipy.stats import chi2

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases
from sautereau.analysis.phases.signals import flagged
from sautereau.analysis.transient.modes import LEAST_SAMPLES, DampedMode, StretchModes, fit_modes
from sautereau.trajectory.motion import Floats

PHASES = ("rest", "free", "held", "released")
LONGEST = 40e-3  # Longest examined part of a phase (s)
DEVIATIONS = 3.0  # Standard uncertainties within which two values count as the same


@dataclass(frozen=True)
class ObservedMode:
    """One damped mode in one phase of one press; its channels are force and velocity."""

    press: int
    """Number of the press, from 0."""
    phase: str
    """One of `PHASES`."""
    mode: DampedMode
    ratio: complex
    """Force, divided by the force that accelerates the key's inertia in this way; dimensionless.

    It is 1 for a rigid key on which only the finger's force oscillates.
    """
    ratio_std: float
    """Standard uncertainty of the logarithm of `ratio`."""
    unseen: str = ""
    """`force` or `velocity` if that channel does not show the mode. The ratio is then a limit."""


@dataclass(frozen=True)
class Stretch:
    """The examined part of one phase; times in s after the trigger."""

    phase: str
    start: float
    stop: float
    time: Floats
    """Shape (n,)."""
    signals: Floats
    """Force [N] and velocity [m/s], shape (2, n)."""
    modes: StretchModes


@dataclass(frozen=True)
class Examined:
    """One press: its stretches and the modes in them."""

    path: Path
    simulated: bool
    speed: float
    """m/s, of the jack before contact."""
    stretches: tuple[Stretch, ...]
    observed: tuple[ObservedMode, ...]
    notes: tuple[str, ...]
    """Phases that could not be examined, with reasons."""


def examine(press: Press, phases: Phases, number: int = 0) -> Examined:
    """Return the damped modes of one press.

    Args:
        number: Number of the press among several, from 0.

    Raises:
        AnalysisError: The key does not move, or samples are not finite numbers.
    """
    time = press.time
    if not phases.bottom > phases.start:
        raise AnalysisError(
            f"press {press.path}: the key does not move down, so it has no transient; check the"
            " aim and the sign of the vibrometer"
        )
    signals = np.array([_bridged(press, time, name) for name in ("force", "velocity")])
    low_pass = _LowPass(press.rate)
    rest, _ = low_pass(time, signals, time[0], _rest_end(press, phases))
    noise = _Noise(rest, signals, low_pass.rate)
    stretches, notes = [], []
    for phase, start, stop in _bounds(press, phases, signals[0], notes):
        part, at = low_pass(time, signals, start, stop)
        if part.shape[1] < LEAST_SAMPLES:
            notes.append(f"{phase} phase of {(stop - start) * 1e3:.3g} ms: too short for modes")
            continue
        modes = fit_modes(part, low_pass.rate, noise.white)
        stretches.append(Stretch(phase, start, stop, at, part, modes))
    observed = [
        _observed(press, number, stretch, mode, low_pass)
        for stretch in stretches
        for mode in stretch.modes.modes
        if stretch.phase == "rest" or noise.is_below(mode)
    ]
    found = tuple(stretches), tuple(observed), tuple(notes)
    return Examined(press.path, press.simulated, phases.free_speed, *found)


def _bridged(press: Press, time: Floats, name: str) -> Floats:
    """Return a channel with straight lines in place of its flagged samples."""
    signal = press.samples[name]
    if not np.isfinite(signal).all():
        raise AnalysisError(
            f"press {press.path}: {int(np.sum(~np.isfinite(signal)))} samples of its {name} are"
            " not finite numbers; check the recording, and press again"
        )
    good = ~flagged(press, name)
    return np.interp(time, time[good], signal[good]) if good.any() else signal


def _rest_end(press: Press, phases: Phases) -> float:
    """Return the end [s] of the rest before the motion."""
    rise = press.samples["jack_rise"]
    moved = int(np.argmax(rise > 3e-4 * rise.max()))
    return min(phases.start, float(press.time[moved])) - 1e-3


def _bounds(
    press: Press, phases: Phases, force: Floats, notes: list[str]
) -> list[tuple[str, float, float]]:
    """Return phase, start and stop [s] of every stretch to examine."""
    time = press.time
    rest = _rest_end(press, phases)
    found = [("rest", max(float(time[0]), rest - LONGEST), rest)]
    speed = press.samples["jack_speed"]
    moving = (time > phases.start) & (speed >= 0.95 * phases.free_speed)  # The end of the run-up
    steady = float(time[np.argmax(moving)])
    first = min(phases.plucks, key=lambda held: held.contact, default=None)
    contact = first.contact - DEVIATIONS * first.contact_std if first else phases.bottom
    if not first:
        notes.append("no pluck was found: everything before the bottom counts as the free phase")
    found.append(("free", max(steady, contact - LONGEST), contact))
    level = np.median(force[(time > steady) & (time < contact)]) if contact > steady else 0.0
    for number, pluck in enumerate(phases.plucks):
        start = pluck.contact + DEVIATIONS * pluck.contact_std
        stop = pluck.release - DEVIATIONS * pluck.release_std
        found.append(("held", start, min(stop, start + LONGEST)))
        rest_of = phases.plucks[number + 1 :]
        stop = rest_of[0].contact - DEVIATIONS * rest_of[0].contact_std if rest_of else np.inf
        stop = min(stop, phases.bottom, phases.bottomed or np.inf)
        start = pluck.release + DEVIATIONS * pluck.release_std
        # Else the finger is off the key.
        touching = _touching(time, force > 0.3 * level, start, stop)
        if touching[0] > start + 1e-3:
            notes.append(
                f"the key leaves the finger after release at {pluck.release * 1e3:.5g} ms:"
                f" the released phase is examined from {touching[0] * 1e3:.5g} ms"
            )
        found.append(("released", touching[0], min(touching[1], touching[0] + LONGEST)))
    return [(phase, start, max(start, stop)) for phase, start, stop in found]


def _touching(time: Floats, touching: np.ndarray, start: float, stop: float) -> tuple[float, float]:
    """Return start and stop [s] of the first long enough stretch with finger contact.

    If all are short, return the longest one.
    """
    inside = slice(*np.searchsorted(time, (start, stop)))
    edges = np.diff(np.concatenate([[0], touching[inside].astype(int), [0]]))
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    if not len(begins):
        return start, start
    at = time[inside]
    lengths = at[ends] - at[begins]
    which = int(np.argmax(lengths >= min(LONGEST / 2, lengths.max())))
    return float(at[begins[which]]), float(at[ends[which]])


class _LowPass:
    """Low-pass filter and decimation of a stretch."""

    def __init__(self, rate: float):
        self.factor = max(1, int(rate // 10e3))  # At least 10 kHz remain
        self.full, self.rate = rate, rate / self.factor
        taps = 12 * self.factor + 1  # In decimated samples
        self.weights = np.ones(1)
        if self.factor > 1:
            self.weights = np.asarray(firwin(taps, 0.9 / self.factor), float)

    def __call__(
        self, time: Floats, signals: Floats, start: float, stop: float
    ) -> tuple[Floats, Floats]:
        """Return the decimated signals between two instants, and their times."""
        first, last = np.searchsorted(time, (start, stop))
        last = max(last, first)
        if last - first < len(self.weights):
            return signals[:, :0], time[:0]
        half = len(self.weights) // 2
        passed = np.array([np.convolve(s, self.weights, "valid") for s in signals[:, first:last]])
        return passed[:, :: self.factor], time[first + half : last - half : self.factor]

    def gain(self, frequency: float) -> float:
        """Return the gain of the filter at a frequency [Hz]."""
        place = np.arange(len(self.weights)) - len(self.weights) // 2
        return float(self.weights @ np.cos(2 * np.pi * frequency / self.full * place))


class _Noise:
    """The noise of force and velocity at rest."""

    def __init__(self, rest: Floats, signals: Floats, rate: float):
        largest = np.abs(signals).max(axis=1)
        floor = np.array([1e-6, 1e-9]) + 1e-6 * largest
        n = rest.shape[1]
        if n < LEAST_SAMPLES:
            self.white, self.level = 1e-3 * largest + floor, np.ones((2, 2))
            self.frequency = np.array([0.0, rate])
            return
        line = np.polynomial.legendre.legvander(np.linspace(-1, 1, n), 2)
        level = rest - (line @ np.linalg.lstsq(line, rest.T, rcond=None)[0]).T
        window = np.hanning(n)
        power = np.abs(np.fft.rfft(level * window, axis=1)) ** 2 / np.sum(window**2)
        # Hum is a narrow line, which the median of a band ignores.
        band = power[:, int(0.05 * n) : int(0.38 * n)]
        self.white = np.maximum(np.sqrt(np.median(band, axis=1) / np.log(2)), floor)
        # So does that of the bins around it: what oscillates at rest as well is no noise.
        around = median_filter(power, (1, 15)) / np.log(2)  # A line takes 3 to 5 bins
        self.level = np.maximum(1.0, np.sqrt(around) / self.white[:, None])
        self.frequency = np.fft.rfftfreq(n, 1 / rate)

    def is_below(self, mode: DampedMode) -> bool:
        """Return whether the noise at a mode's frequency is smaller than the mode."""
        local = np.array([np.interp(mode.frequency, self.frequency, row) for row in self.level])
        # In uncertainties at the noise's level.
        return bool(np.any(np.abs(mode.amplitude) > 4.0 * local * mode.amplitude_std))


def _observed(
    press: Press, number: int, stretch: Stretch, mode: DampedMode, low_pass: _LowPass
) -> ObservedMode:
    """Return a mode without the gain of the low-pass filter, with its ratio of force to inertia."""
    key = press.rig.key
    inertia = key.inertia + press.rig.jack.mass * key.jack_arm**2
    gain = low_pass.gain(mode.frequency)
    mode = replace(mode, amplitude=mode.amplitude / gain, amplitude_std=mode.amplitude_std / gain)
    sizes = np.abs(mode.amplitude)
    weak = sizes < DEVIATIONS * mode.amplitude_std
    unseen = ("force", "velocity")[int(np.argmax(weak))] if weak.any() else ""
    used = np.where(weak, DEVIATIONS * mode.amplitude_std, mode.amplitude)
    pole = -mode.decay + 2j * np.pi * mode.frequency
    needed = inertia / (key.laser_arm * key.press_arm) * pole * used[1]
    relative = mode.amplitude_std / np.maximum(sizes, DEVIATIONS * mode.amplitude_std)
    ratio, ratio_std = complex(used[0] / needed), float(np.hypot(*relative))
    return ObservedMode(number, stretch.phase, mode, ratio, ratio_std, unseen)


SAME = 0.04
"""Relative difference up to which frequencies belong to one oscillation. Finger contact and string
add stiffness in some phases."""


@dataclass(frozen=True)
class Oscillation:
    """Modes of the same frequency in several phases and presses."""

    observed: tuple[ObservedMode, ...]
    frequency: float
    """Hz, weighted mean."""
    frequency_std: float
    """Hz, standard uncertainty; it includes the scatter if that is larger than expected."""
    damping: float
    """Damping ratio, weighted mean."""
    damping_std: float
    """Standard uncertainty of the damping ratio."""
    consistent: bool
    """Whether the frequencies agree within their uncertainties."""
    seen: dict[str, float]
    """For each phase: fraction of the stretches that show it, among those that could show it."""
    presses: int
    """Number of presses that show it."""
    speeds: tuple[float, float]
    """m/s, jack speeds of the slowest and the fastest of these presses."""

    @property
    def clearest(self) -> ObservedMode:
        """The mode whose ratio of force to velocity has the smallest uncertainty."""
        return min(self.observed, key=lambda each: (bool(each.unseen), each.ratio_std))


def combine(examined: Sequence[Examined]) -> list[Oscillation]:
    """Return the oscillations of several presses on one bench, ordered by frequency."""
    modes = sorted(
        (each for press in examined for each in press.observed), key=lambda o: o.mode.frequency
    )
    groups: list[list[ObservedMode]] = []
    for each in modes:
        if groups:
            known = [(o.mode.frequency, o.mode.frequency_std) for o in groups[-1]]
            mean, std, _ = _mean(known)
            doubt = DEVIATIONS * float(np.hypot(std, each.mode.frequency_std))
            if each.mode.frequency - mean < SAME * mean + min(doubt, SAME * mean):
                groups[-1].append(each)
                continue
        groups.append([each])
    # An oscillation that only the rest shows is not transient.
    return [_oscillation(g, examined) for g in groups if any(o.phase != "rest" for o in g)]


def _mean(values: list[tuple[float, float]]) -> tuple[float, float, bool]:
    """Return weighted mean, standard uncertainty, and whether the scatter is as expected."""
    value, std = np.array(values).T
    weight = 1 / std**2
    mean = float(weight @ value / weight.sum())
    if len(value) == 1:
        return mean, float(std[0]), True
    scatter = float(weight @ (value - mean) ** 2)
    dof = len(value) - 1
    spread = float(np.sqrt(max(1.0, scatter / dof) / weight.sum()))
    return mean, spread, bool(chi2.sf(scatter, dof) > 0.01)  # Else they do not agree


def _oscillation(group: list[ObservedMode], examined: Sequence[Examined]) -> Oscillation:
    frequency, frequency_std, consistent = _mean(
        [(o.mode.frequency, o.mode.frequency_std) for o in group]
    )
    damping, damping_std, _ = _mean([(o.mode.damping, o.mode.damping_std) for o in group])
    typical = np.median([np.abs(o.mode.amplitude) for o in group], axis=0)
    shown = {(o.press, o.phase) for o in group}
    numbers = sorted({o.press for o in group})
    speeds = [examined[number].speed for number in numbers]
    return Oscillation(
        tuple(group),
        frequency,
        frequency_std,
        damping,
        damping_std,
        consistent,
        _seen(shown, typical, examined),
        len(numbers),
        (min(speeds), max(speeds)),
    )


def _seen(
    shown: set[tuple[int, str]], typical: Floats, examined: Sequence[Examined]
) -> dict[str, float]:
    found = {}
    for phase in PHASES:
        cases = []
        for number, press in enumerate(examined):
            stretches = [s for s in press.stretches if s.phase == phase]
            if (number, phase) in shown:
                cases.append(1.0)
            # A mode of typical amplitude would be visible.
            elif any(np.any(typical > 2.0 * s.modes.smallest) for s in stretches):
                cases.append(0.0)
        if cases:
            found[phase] = float(np.mean(cases))
    return found
