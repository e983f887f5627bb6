"""Goodness of a fit: whether the model fits the presses.

A wrong model can have small residuals and narrow intervals. Four signs of a wrong model are tested:
the residual exceeds the noise at rest; it is larger while a string is held than elsewhere; it
repeats from press to press, unlike noise; a calibration is fitted far from its stated value.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sautereau.analysis.identify.fit import Fit, rms
from sautereau.analysis.identify.observed import FREE, HELD, WINDOW, Observed
from sautereau.analysis.identify.parameters import (
    CALIBRATIONS,
    FORCE,
    FORCE_GAIN,
    MODE,
    TIME,
    VELOCITY_GAIN,
)
from sautereau.analysis.text import quantity_in_rig
from sautereau.trajectory.motion import Floats

NOISE_MAX = 1.2  # Largest ratio of the averaged residual to the noise at rest, not averaged
REPEATED_MAX = 0.5
"""Largest allowed ratio of the repeated part of the residual to the other part, or to the noise at
rest. A repeated part widens the intervals."""
PRIOR_MAX = 3.0  # Standard uncertainties by which a fitted calibration may differ from the rig's
HOW = {
    TIME: "free it, or correct the delays of the channels",
    FORCE_GAIN: "calibrate the force transducer, or measure key.press_arm, which acts alike",
    VELOCITY_GAIN: "calibrate the vibrometer, or measure key.laser_arm, which acts alike, or the"
    " shape of the plectrum (sautereau outline): a taper resembles it",
}  # How to correct a wrong calibration


@dataclass(frozen=True)
class Quality:
    """The goodness of a fit; a statistic is None if the recordings do not allow it."""

    noise: float | None
    """N, RMS residual caused by the noise at rest, smoothed as in the fit."""
    free_residual: float
    """N, RMS force residual on the way down without a string. It is averaged over about a period of
    the string, as the next one is."""
    held_residual: float | None
    """N, RMS force residual while a string is held."""
    repeated_residual: float | None
    """N, RMS of the part of the force residual that repeats from press to press."""
    repetition: float
    """Variance of the mean residual of all presses, divided by that of independent residuals; at
    least 1. A repeated part does not become smaller with more presses."""
    autocorrelation: float
    """Correlation coefficient of residuals that are one smoothing window apart."""
    offsets: dict[str, float]
    """Fitted errors of the calibrations, divided by their standard uncertainties."""
    quiet: bool
    """Whether the noise at rest explains the residual without a string. True if it is unknown:
    nothing then speaks for further modes of the key; it is no sign that the model fits."""
    repeats: bool
    """Whether more of the residual without a string repeats from press to press than noise
    explains. Modes of the key leave it there, and errors of plectrum and string do not."""
    reasons: tuple[str, ...]
    """Why the model does not fit; empty if nothing speaks against it."""

    @property
    def scale(self) -> float:
        """N, estimated RMS of the part of the force residual that is no error of the model."""
        known = (self.free_residual, self.held_residual, self.noise and NOISE_MAX * self.noise)
        return min(value for value in known if value)

    @property
    def fits(self) -> bool | None:
        """Whether the model fits; None if nothing speaks against it, but the noise is unknown."""
        if self.reasons:
            return False
        return None if self.noise is None else True

    @property
    def verdict(self) -> str:
        """The same as text."""
        if self.fits is None:
            return (
                "whether the model fits is unknown: the recordings have no rest before or after the"
                " press"
            )
        return "the model fits" if self.fits else "THE MODEL DOES NOT FIT"


def judged(good: Quality, fitted: Fit) -> Quality:
    """Return the goodness of a fit, of `quality`, with the verdict on calibrations and releases."""
    offsets, found = {}, []
    for p, value in zip(fitted.problem.free, fitted.values.tolist(), strict=True):
        if p.hidden and p.name in CALIBRATIONS and p.mean is not None and p.std:
            offsets[p.name] = (value - p.mean) / p.std
            found.append((p.name, p.unit, value))
    reasons = [
        f"{name}: the fit, {quantity_in_rig(value, unit)}, is {abs(offsets[name]):.1f} standard"
        f" uncertainties from the calibration: {HOW[name]}"
        for name, unit, value in found
        if abs(offsets[name]) > PRIOR_MAX
    ]
    presses = fitted.problem.dynamics.presses
    rises = fitted.problem.dynamics.residuals(fitted.values)[1]
    names = [press.name for press in presses for _ in press.release_angles]
    worst = int(np.abs(rises).argmax()) if rises.size else 0
    first = []
    if rises.size and abs(rises[worst]) > PRIOR_MAX:
        # Presses that differ leave the other residuals too.
        first.append(
            f"{names[worst]}: the rise of the jack at the release is {abs(rises[worst]):.2g}"
            f" standard uncertainties {'above' if rises[worst] > 0 else 'below'} the model's: fit"
            " presses of one plectrum and one set-up (sautereau compare says what changes), and"
            " check that release in a plot of the phases"
        )
    slow = float(np.median([press.release_std for press in presses]))
    # Rigid keys have up to 0.1 ms, a fall within 4 ms has 0.08 to 0.66.
    if slow > 0.2e-3 and not any(p.name.startswith(MODE) for p in fitted.problem.free):
        first.append(
            f"the releases are known to {slow * 1e3:.2g} ms only, but a string's force falls"
            " at once on a rigid key: check them in a plot of the phases"
        )
    if FORCE in fitted.instead:
        reasons.append(
            f"{FORCE}: a rigid key fits with a zero and a drift of the force: free it, or"
            " key.gravity_moment, which acts like the zero"
        )
    if fitted.instead and (first or reasons):
        reasons.append(
            "these recordings do not separate wrong calibrations from elastic modes of the key,"
            " which were not tried: if sensors and lengths are right, tap the key (sautereau setup"
            " tap)"
        )
    return replace(good, offsets=offsets, reasons=(*first, *good.reasons, *reasons))


def quality(fitted: Fit) -> Quality:
    """Return the goodness of a fit without its calibrations, which `judged` adds."""
    dynamics = fitted.problem.dynamics
    forces, _ = dynamics.residuals(fitted.values)
    left = [f - w.trend(f) for f, w in zip(forces, fitted.problem.whitenings, strict=True)]
    period = 1 / dynamics.rig.string.frequency
    slow = [_slow(f, p, period) for f, p in zip(left, dynamics.presses, strict=True)]

    def in_phase(which: int) -> list[Floats]:
        pairs = zip(slow, dynamics.presses, strict=True)
        return [f[np.isfinite(f) & (press.phase == which)] for f, press in pairs]

    def repeated_in(*phases: int) -> _Repeated | None:
        return _repeated(dynamics.presses, slow, dynamics.floor, period, phases)

    inside, free = in_phase(HELD), rms(in_phase(FREE))
    noise, reasons = dynamics.noise, []
    quiet = noise is None or free <= NOISE_MAX * float(np.hypot(noise, dynamics.floor))
    if noise is not None and not quiet:
        reasons.append(
            f"the residual without a string is {free * 1e3:.3g} mN, and the noise at rest"
            f" {noise * 1e3:.3g} mN: free the key's frictions, and tap the key for its"
            " modes (sautereau setup tap)"
        )
    instants = sum(map(len, inside))
    held_residual = rms(inside) if instants else None
    if held_residual is not None:
        spread = 1 / np.sqrt(2 * max(1.0, instants * _independent(dynamics.presses, period)))
        # Up to a tenth more than elsewhere, and two standard deviations of that ratio. A residual
        # up to the noise at rest is always allowed, because the held string vibrates. A wrong
        # friction that is hidden in this way is found by the score test.
        allowed = max(free, dynamics.floor) * (1.1 + 2.0 * spread)
        if held_residual > max(allowed, noise or 0.0):
            part = repeated_in(HELD)
            fix = (
                "free plectrum.friction, and measure the string's tension, length and plucking"
                " point, and the shape of the plectrum (sautereau outline)"
            )
            if part and part.size < held_residual / 2:
                fix = (
                    "it differs from press to press: fit presses of one plectrum and one set-up"
                    " (sautereau compare says what changes)"
                )
            reasons.append(
                f"the residual while a string is held is {held_residual * 1e3:.3g} mN, and"
                f" {free * 1e3:.3g} mN without a string: {fix}"
            )
    repeated, free_part = repeated_in(FREE, HELD), repeated_in(FREE)
    if repeated and repeated.size > max(repeated.allowed, REPEATED_MAX * (noise or 0.0)):
        reasons.append(
            f"{repeated.size * 1e3:.3g} mN of the residual repeat from press to press, and noise"
            f" would leave up to {repeated.allowed * 1e3:.3g} mN: an error of the model, or of a"
            " number that is not fitted"
        )
    return Quality(
        noise=noise,
        free_residual=free,
        held_residual=held_residual,
        repeated_residual=repeated.size if repeated else None,
        repetition=repeated.repetition if repeated else 1.0,
        autocorrelation=_autocorrelation(dynamics.presses, left),
        offsets={},
        quiet=quiet,
        repeats=free_part is not None and free_part.size > free_part.chance,
        reasons=tuple(reasons),
    )


def _slow(residual: Floats, press: Observed, period: float) -> Floats:
    """Return the residual averaged over about a period of the string; NaN where it is not fitted.

    The held string vibrates and that of the model does not. The average removes the vibration.
    """
    # An average over a period of the string has at most 9 instants.
    count = min(2 * round(period / press.step / 2) + 1, 9)
    series, slow = np.full(len(press.used), np.nan), np.full(len(press.used), np.nan)
    series[press.used] = residual
    means = np.convolve(series, np.full(count, 1 / count), "valid")
    slow[count // 2 : len(slow) - count // 2] = means
    # No average extends beyond the ends of the pluck. Short phases are not averaged.
    edges = (
        np.convolve(np.diff(press.phase, prepend=press.phase[0]) != 0, np.ones(count), "same") > 0.5
    )
    return np.where(np.isfinite(slow) & ~edges, slow, np.nan)


def _independent(presses: Sequence[Observed], period: float) -> float:
    """Return the number of independent values per instant."""
    # Values of a smoothed force are independent at 0.6 of the windows of smoothing and averaging.
    return presses[0].step / (0.6 * (WINDOW + period))


@dataclass(frozen=True)
class _Repeated:
    """The part of the residual that repeats from press to press."""

    size: float  # N, RMS
    allowed: float  # N, largest size of a model that fits
    chance: float  # N, largest size that noise explains
    repetition: float  # See `Quality`


def _repeated(
    presses: Sequence[Observed],
    slow: Sequence[Floats],
    floor: float,
    period: float,
    phases: Sequence[int],
) -> _Repeated | None:
    """Return the repeated part of the residual in some phases of the presses.

    Presses of different motions are compared separately; the result is that of the motion whose
    repeated part is largest relative to its limit. It is None if no two presses have the same
    motion.
    """
    found = []
    for numbers in _same_motion(presses):
        own = [presses[k] for k in numbers]
        every = np.full((len(own), len(own[0].time)), np.nan)
        for row, press, number in zip(every, own, numbers, strict=True):
            row[:] = np.where(np.isin(press.phase, phases), slow[number], np.nan)
        every = every[:, np.isfinite(every).all(axis=0)]
        n, instants = every.shape
        if n < 2 or instants < 2:
            continue
        within = float(np.mean(np.var(every, axis=0, ddof=1))) + floor**2
        common = max(0.0, float(np.mean(every.mean(axis=0) ** 2)) - within / n)
        spread = np.sqrt(2 / max(1.0, instants * _independent(presses, period))) * within / n
        chance = 3.0 * spread  # Three standard deviations are allowed
        allowed = REPEATED_MAX**2 * within + chance
        size, allowed, chance = np.sqrt([common, allowed, chance]).tolist()
        found.append(_Repeated(size, allowed, chance, 1 + n * common / within))
    return max(found, key=lambda each: each.size / each.allowed, default=None)


def _same_motion(presses: Sequence[Observed]) -> list[list[int]]:
    """Return the numbers of the presses, grouped by their motion."""
    groups: list[list[int]] = []
    for number, press in enumerate(presses):
        speed = press.motion.velocity
        for group in groups:
            first = presses[group[0]].motion.velocity
            # Velocities of one motion differ by less than 5 % RMS.
            if len(speed) == len(first) and rms([speed - first]) < 0.05 * rms([first]):
                group.append(number)
                break
        else:
            groups.append([number])
    return groups


def _autocorrelation(presses: Sequence[Observed], left: Sequence[Floats]) -> float:
    """Return the correlation coefficient of residuals that are one smoothing window apart."""
    lag = max(1, round(WINDOW / presses[0].step))
    products, squares = [], []
    for press, residual in zip(presses, left, strict=True):
        series = np.zeros(len(press.used))
        series[press.used] = residual
        both = press.used[lag:] & press.used[:-lag]
        products.append((series[lag:] * series[:-lag])[both])
        squares.append(residual**2)
    every = np.concatenate(products)
    total = float(np.mean(np.concatenate(squares)))
    return float(np.mean(every)) / total if len(every) and total > 0 else 0.0
