"""Attribution of oscillations to parts of the bench, by a small Bayesian model.

The probability of a source is proportional to prior x frequency x damping x phases x ratio; these
factors are treated as independent. All numbers are chosen by hand, from the physics and from
simulated presses. docs/transient.md explains them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import degrees, exp, isnan, log, log10, pi, sqrt
from pathlib import Path

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from sautereau.analysis.model.choirs import choirs
from sautereau.analysis.transient.evidence import PHASES, ObservedMode, Oscillation
from sautereau.analysis.transient.modes import MOST_DAMPING
from sautereau.rig.disk import table_beside
from sautereau.rig.instrument import Choir
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats


class Source(StrEnum):
    """A part of the bench that can oscillate."""

    STRING = "string"
    KEY = "key"
    """The key's bending and heave, and the jack on its cloth."""
    FINGER = "finger"
    """Arm, servo and fingertip pad, with the key's rigid inertia."""
    TRANSDUCER = "transducer"
    """The fingertip's own mass on the transducer."""
    MAINS = "mains hum"
    STEADY = "steady tone"
    """Undamped and there at rest too, such as a pump or a higher multiple of the hum."""
    OTHER = "other"
    """Not an oscillation of a linear bench: changing contact, motion of the drive, noise."""


@dataclass(frozen=True)
class SourceModel:
    """What is expected of the oscillations of one source."""

    prior: float
    """Probability of the source before anything is measured."""
    seen: tuple[float, float, float, float]
    """Probability that each of `evidence.PHASES` shows the oscillation, if the noise permits it."""
    ratio: float
    """Mean of the decimal logarithm of `evidence.ObservedMode.ratio`."""
    ratio_std: float
    """Standard deviation of that logarithm."""
    band: tuple[float, float] | None = None
    """Range of the frequency (Hz), uniform in its logarithm; None if partials are known instead."""
    damping_std: float | None = None
    """Scale of the damping ratio, half-normal; None for a uniform distribution."""
    in_phase: float = 0.0
    """Probability that the force is in phase with the key's inertia; for the key also in opposite
    phase. Otherwise every phase is equally probable."""


def _model(cells: Sequence[str]) -> SourceModel:
    """Return the model of one line of attribute.csv, where an empty cell is nothing."""
    prior, *seen, ratio, ratio_std, low, high, damping_std, in_phase = (
        float(cell or "nan") for cell in cells
    )
    rest, free, held, released = seen
    return SourceModel(
        prior,
        (rest, free, held, released),
        ratio,
        ratio_std,
        band=None if isnan(low) else (low, high),
        damping_std=None if isnan(damping_std) else damping_std,
        in_phase=in_phase,
    )


MODELS = {Source(source): _model(cells) for source, *cells in table_beside(__file__)}
DECIDING_PRESS = {
    frozenset({Source(source), Source(other)}): press
    for source, other, press in table_beside(Path(__file__).with_name("deciding"))
}  # Which press would decide between two sources
HUM = "a recording at rest with the drives off: only hum and steady tones remain"
"""Which recording would decide between them and another source."""
AGAIN = "more presses at the same speed: a mode of the bench returns at the same frequency"
"""Which presses would decide whether an oscillation belongs to the bench."""


FULL = (20.0, 20000.0)  # Range of a frequency about which nothing is known (Hz)
ODD = 0.05  # Weight of `FULL` in every source, and of its `band` beside a measured mode
FLEXIBLE_PART = 0.25  # Probability that the key bends or heaves under an oscillating finger
HIGHEST = 8e3  # Hz, of a string's partials, whose weight is 1 / f^2, as for a bent string


@dataclass(frozen=True)
class Attributed:
    """An oscillation with the probability of every source."""

    oscillation: Oscillation
    probability: Mapping[Source, float]
    source: Source | None
    """The most probable source; None if the recordings do not decide it."""
    deciding: str
    """Which press would decide; empty if it is decided."""


def attribute(
    oscillations: Sequence[Oscillation],
    rig: Rig,
    known: Mapping[Source, Sequence[float]] | None = None,
) -> list[Attributed]:
    """Return the probability of every source for each oscillation.

    Args:
        known: Hz, modes that were measured separately, for example by a tap on the key.
    """
    held = np.concatenate([held_frequencies(c, HIGHEST) for c in choirs(rig)])
    free = np.concatenate([free_frequencies(c, HIGHEST) for c in choirs(rig)])
    return [_attributed(each, rig, (held, free), known or {}) for each in oscillations]


def _attributed(
    oscillation: Oscillation,
    rig: Rig,
    strings: tuple[Floats, Floats],
    known: Mapping[Source, Sequence[float]],
) -> Attributed:
    weight = {
        source: model.prior
        * _frequency(source, oscillation, rig, strings, known.get(source, ()))
        * _damping(source, oscillation)
        * _phases(source, oscillation, bool(rig.more_choirs))
        * _ratio(source, oscillation.clearest)
        for source, model in MODELS.items()
    }
    total = sum(weight.values())
    probability = {source: float(each / total) for source, each in weight.items()}
    first, second = sorted(Source, key=lambda s: -probability[s])[:2]
    # Less probable sources are not decided.
    decided = probability[first] >= 0.8 and first is not Source.OTHER
    deciding = DECIDING_PRESS.get(frozenset({first, second}), HUM)
    deciding = AGAIN if Source.OTHER in (first, second) else deciding
    deciding = "" if decided else deciding
    return Attributed(oscillation, probability, first if decided else None, deciding)


def _frequency(
    source: Source,
    found: Oscillation,
    rig: Rig,
    strings: tuple[Floats, Floats],
    known: Sequence[float],
) -> float:
    """Return the density of the logarithm of the frequency; strings: partials, held and free."""
    frequency, doubt = found.frequency, found.frequency_std / found.frequency
    anywhere = 1 / log(FULL[1] / FULL[0])
    if source is Source.STRING:
        held, free = (_partials(frequency, each, 0.03, doubt, 1 / each**2) for each in strings)
        likely = 0.8 * held + 0.2 * free
    elif source is Source.MAINS:
        return _partials(frequency, (50.0, 60.0, 100.0, 120.0, 150.0, 180.0), 0.004, doubt)
    else:
        low, high = MODELS[source].band or FULL
        likely = 1 / log(high / low) if low <= frequency <= high else 0.0
        if source is Source.FINGER:
            low, high = found.speeds
            # A frequency that is constant over such a range of speeds is no ripple.
            ripple = found.consistent and high > 1.2 * low
            likely *= 0.8 if ripple else 1.0
            rate = 1 / rig.controller.sample_period
            of_servo = _partials(frequency, [rate, 2 * rate, 3 * rate], 0.01, doubt)
            likely = 0.85 * likely + 0.15 * of_servo
        if known:
            near = _partials(frequency, known, 0.03, doubt)
            likely = ODD * likely + (1 - ODD) * near
    return (1 - ODD) * likely + ODD * anywhere


def _partials(
    frequency: float,
    partials: Sequence[float] | Floats,
    std: float,
    doubt: float,
    weights: Floats | None = None,
) -> float:
    """Return the density of the logarithm for several partials, by default of equal weight."""
    weights = np.ones(len(partials)) if weights is None else weights
    away = np.log(frequency / np.asarray(partials))
    return float(norm.pdf(away, scale=sqrt(std**2 + doubt**2)) @ weights / weights.sum())


def _damping(source: Source, found: Oscillation) -> float:
    """Return the density of the estimated damping ratio, a true one above 0 with normal noise.

    Only what is no oscillation of the bench can grow, and has every damping.
    """
    if source is Source.OTHER:
        return 1 / MOST_DAMPING
    std, noise = MODELS[source].damping_std, found.damping_std
    if std is None:
        return float(norm.cdf(found.damping / noise)) / MOST_DAMPING
    both = float(np.hypot(std, noise))
    above_0 = norm.cdf(found.damping * std / (noise * both))
    return 2 * float(norm.pdf(found.damping, scale=both) * above_0)


def _phases(source: Source, found: Oscillation, several: bool) -> float:
    """Return the probability that just these phases show the oscillation."""
    likely = 1.0
    for phase, chance in zip(PHASES, MODELS[source].seen, strict=True):
        if phase not in found.seen:
            continue
        if source is Source.STRING and phase == "released" and several:
            chance = 0.3  # With several choirs; it shows another one's string
        likely *= chance if found.seen[phase] >= 0.5 else 1 - chance
    return likely


def _ratio(source: Source, clearest: ObservedMode) -> float:
    """Return the density of the ratio of force to inertia, by its size and its phase."""
    model = MODELS[source]
    size, doubt = log10(abs(clearest.ratio)), clearest.ratio_std / log(10)
    parts = [(1.0, model.ratio, model.ratio_std)]
    if source is Source.FINGER:
        rigid = 1 - FLEXIBLE_PART, model.ratio, model.ratio_std
        # Then the decimal logarithm of the finger's ratio is 0 with a standard deviation of 0.5.
        parts = [rigid, (FLEXIBLE_PART, 0.0, 0.5)]
    law = {"velocity": norm.sf, "force": norm.cdf}.get(clearest.unseen, norm.pdf)
    likely = float(sum(w * law(size, mean, sqrt(std**2 + doubt**2)) for w, mean, std in parts))
    if clearest.unseen:
        return likely / 2
    turned = degrees(float(np.angle(clearest.ratio)))
    wide = degrees(2 * pi * clearest.mode.frequency * 30e-6)  # 30 us between the channels
    # 20 deg, of the expected phase.
    spread = sqrt(20.0**2 + wide**2 + degrees(clearest.ratio_std) ** 2)
    aligned = _about(turned, 0.0, spread)
    if source is Source.KEY:
        aligned = (aligned + _about(turned, 180.0, spread)) / 2
    return likely * (model.in_phase * aligned + (1 - model.in_phase)) / 2


def _about(angle: float, centre: float, spread: float) -> float:
    """Return the density of an angle [deg], divided by that of a uniform distribution."""
    away = (angle - centre + 180) % 360 - 180
    return 360 * exp(-0.5 * (away / spread) ** 2) / (spread * sqrt(2 * pi))


def free_frequencies(choir: Choir, highest: float) -> Floats:
    """Return the partials of the ideal string up to a frequency [Hz], shape (n,)."""
    fundamental = choir.string.frequency
    return fundamental * np.arange(1, int(highest / fundamental) + 1, dtype=float)


def held_frequencies(choir: Choir, highest: float) -> Floats:
    """Return the frequencies [Hz] of the string on its plectrum, up to a frequency; shape (n,).

    An ideal string with a spring k at the plucking point a: the slope changes there by k / T times
    the displacement, so T p sin(p L) + k sin(p a) sin(p (L - a)) = 0 with p = w / c (P. Morse,
    Vibration and Sound, 1948, section 9). k = 3 EI / s^3 is the tip stiffness of a uniform
    plectrum that touches the string at s, its length minus the overlap.
    """
    string, plectrum = choir.string, choir.plectrum
    section = plectrum.width * plectrum.thickness**3 / 12
    length = plectrum.length - plectrum.overlap
    stiffness = 3 * plectrum.modulus * section / length**3
    whole, part = string.length, string.plucking_point

    def condition(frequency: float) -> float:
        p = np.pi * frequency / (string.frequency * whole)
        return float(
            string.tension * p * np.sin(p * whole)
            + stiffness * np.sin(p * part) * np.sin(p * (whole - part))
        )

    count = max(2, int(40 * highest / string.frequency))  # 40 intervals for each free partial
    grid = np.linspace(0.3 * string.frequency, highest, count)
    values = np.array([condition(f) for f in grid])
    places = np.flatnonzero(values[1:] * values[:-1] < 0)
    return np.array([brentq(condition, grid[i], grid[i + 1]) for i in places], dtype=float)
