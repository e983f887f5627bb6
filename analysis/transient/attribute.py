"""To which part of the bench an oscillation belongs: a small Bayesian model.

The probability of a source is proportional to prior x frequency x damping x phases x ratio, as if
independent. All numbers are chosen by hand, from the physics and with simulated presses in view;
docs/transient.md explains them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import degrees, exp, log, log10, pi, sqrt

import numpy as np
from scipy.stats import norm

from sautereau.analysis.model.choirs import choirs
from sautereau.analysis.transient.combine import Oscillation
from sautereau.analysis.transient.evidence import PHASES, Observed
from sautereau.analysis.transient.held_string import free_frequencies, held_frequencies
from sautereau.analysis.transient.modes import MOST_DAMPING
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats

DECIDED = 0.8
"""Least probability of an attribution."""


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
    OTHER = "other"
    """No oscillation of a linear bench: changing contact, motion of the drive, noise."""


PRIOR = {
    Source.STRING: 0.2,
    Source.KEY: 0.2,
    Source.FINGER: 0.2,
    Source.TRANSDUCER: 0.2,
    Source.MAINS: 0.1,
    Source.OTHER: 0.1,
}
SEEN = {
    # rest, free, held, released
    Source.STRING: (0.01, 0.03, 0.85, 0.05),
    Source.KEY: (0.05, 0.6, 0.75, 0.85),
    Source.FINGER: (0.1, 0.7, 0.75, 0.75),
    Source.TRANSDUCER: (0.05, 0.5, 0.6, 0.7),
    Source.MAINS: (0.9, 0.9, 0.9, 0.9),
    Source.OTHER: (0.2, 0.3, 0.3, 0.3),
}
"""Probability that a phase shows the oscillation where it could be seen."""
AFTER_ANOTHER = 0.3
"""The same for a string in the released phase where a rig has several choirs."""
BROAD = {
    Source.KEY: (60.0, 4000.0),
    Source.FINGER: (20.0, 2000.0),
    Source.TRANSDUCER: (700.0, 20000.0),
    Source.OTHER: (20.0, 20000.0),
}
"""Hz, range of a frequency that is uniform in its logarithm."""
FULL = (20.0, 20000.0)
"""Hz, range of a frequency about which nothing is known."""
ODD = 0.05
"""Dimensionless weight of `FULL` in every source, and of `BROAD` beside a measured mode."""
STRING_STD, FREE_PART = 0.03, 0.2
"""Relative uncertainty of a string's frequency, and weight of the partials of the free string."""
SERVO_PART, SERVO_STD = 0.15, 0.01
"""Weight of the multiples of the controller's sample frequency, and their relative uncertainty."""
KNOWN_STD = 0.03
"""Relative change of a measured mode by the contact with the finger."""
MAINS = (50.0, 60.0, 100.0, 120.0, 150.0, 180.0)
MAINS_STD = 0.004
DAMPING = {Source.STRING: 0.02, Source.MAINS: 0.002}
"""Standard deviation of the fraction of critical damping; of other sources it is uniform."""
RATIO = {
    # mean and standard deviation of the decimal logarithm
    Source.STRING: (-0.1, 0.6),
    Source.KEY: (-0.2, 0.7),
    Source.FINGER: (0.0, 0.12),
    Source.TRANSDUCER: (1.0, 0.4),
    Source.MAINS: (1.0, 1.0),
    Source.OTHER: (0.0, 0.8),
}
"""Of the size of the force over that of the key's inertia."""
FLEXIBLE = 0.25, 0.0, 0.5
"""Probability that the finger's ratio is not that of a rigid key, as the key bends or heaves; then
mean and standard deviation of the logarithm of its size."""
IN_PHASE_STD = 20.0
"""deg, about 0 deg for the finger, about 0 or 180 deg for the key."""
IN_PHASE = {Source.FINGER: 0.95, Source.KEY: 0.8}
"""Probability of that phase; otherwise every phase is alike."""
HIGHEST = 8e3
"""Hz, of the partials of a string; their weights are as 1 / f^2, as those of a bent string."""
DELAY_STD = 30e-6
"""s, uncertainty of the delay between the channels."""
SCALING = 0.2
"""Ratio of jack speeds from which a constant frequency excludes a ripple of the drive."""
WHICH_PRESS = {
    frozenset({Source.STRING, Source.KEY}): "the same press with the string muted by felt: a mode"
    " of the string disappears or moves, one of the key stays",
    frozenset({Source.STRING, Source.FINGER}): "a press at another jack speed with the string"
    " muted: the string's frequency does not depend on the speed and disappears with the felt",
    frozenset({Source.STRING, Source.TRANSDUCER}): "the same press with the string muted: a mode"
    " of the transducer stays",
    frozenset({Source.KEY, Source.FINGER}): "a tap on the resting key, with the finger away from"
    " it: only modes of the key remain",
    frozenset({Source.KEY, Source.TRANSDUCER}): "a tap on the resting key, with the finger away"
    " from it: only the velocity shows a mode of the key",
    frozenset({Source.FINGER, Source.TRANSDUCER}): "a tap on the fingertip in the air: only the"
    " transducer's own mode remains",
}
HUM = "a recording at rest with the drives off: only the hum remains"
AGAIN = "more presses at the same speed: a mode of the bench returns at the same frequency"


@dataclass(frozen=True)
class Attributed:
    """An oscillation with the probability of every source."""

    oscillation: Oscillation
    probability: Mapping[Source, float]
    source: Source | None
    """The most probable source; None where it cannot be decided from these recordings."""
    deciding: str
    """The press that would decide; empty where it is decided."""


def attribute(
    oscillations: Sequence[Oscillation],
    rig: Rig,
    known: Mapping[Source, Sequence[float]] | None = None,
) -> list[Attributed]:
    """Return the probability of every source for each oscillation.

    Args:
        oscillations: Of presses on one bench.
        rig: The bench.
        known: Hz, modes that were measured otherwise, for example by a tap on the key.
    """
    strings = _Strings(
        held=np.concatenate([held_frequencies(c, HIGHEST) for c in choirs(rig)]),
        free=np.concatenate([free_frequencies(c, HIGHEST) for c in choirs(rig)]),
    )
    return [_attributed(each, rig, strings, known or {}) for each in oscillations]


@dataclass(frozen=True)
class _Strings:
    """Partials of all strings [Hz]; shape (n,)."""

    held: Floats
    free: Floats


def _attributed(
    oscillation: Oscillation,
    rig: Rig,
    strings: _Strings,
    known: Mapping[Source, Sequence[float]],
) -> Attributed:
    weight = {
        source: prior
        * _frequency(source, oscillation, rig, strings, known.get(source, ()))
        * _damping(source, oscillation)
        * _phases(source, oscillation, bool(rig.more_choirs))
        * _ratio(source, oscillation.clearest)
        for source, prior in PRIOR.items()
    }
    total = sum(weight.values())
    probability = {source: float(each / total) for source, each in weight.items()}
    first, second = sorted(Source, key=lambda s: -probability[s])[:2]
    decided = probability[first] >= DECIDED and first is not Source.OTHER
    deciding = "" if decided else _deciding(first, second)
    return Attributed(oscillation, probability, first if decided else None, deciding)


def _deciding(first: Source, second: Source) -> str:
    if Source.OTHER in (first, second):
        return AGAIN
    return WHICH_PRESS.get(frozenset({first, second}), HUM)


def _frequency(
    source: Source, found: Oscillation, rig: Rig, strings: _Strings, known: Sequence[float]
) -> float:
    """Return the density of the logarithm of the frequency."""
    frequency, doubt = found.frequency, found.frequency_std / found.frequency
    anywhere = 1 / log(FULL[1] / FULL[0])
    if source is Source.STRING:
        held, free = (
            _partials(frequency, each, STRING_STD, doubt, 1 / each**2)
            for each in (strings.held, strings.free)
        )
        likely = (1 - FREE_PART) * held + FREE_PART * free
    elif source is Source.MAINS:
        likely = _partials(frequency, MAINS, MAINS_STD, doubt)
    else:
        likely = _uniform(frequency, *BROAD[source])
        if source is Source.FINGER:
            low, high = found.speeds
            ripple = found.consistent and high > (1 + SCALING) * low
            likely *= 0.8 if ripple else 1.0
            rate = 1 / rig.controller.sample_period
            of_servo = _partials(frequency, [rate, 2 * rate, 3 * rate], SERVO_STD, doubt)
            likely = (1 - SERVO_PART) * likely + SERVO_PART * of_servo
        if known:
            near = _partials(frequency, known, KNOWN_STD, doubt)
            likely = ODD * likely + (1 - ODD) * near
    return (1 - ODD) * likely + ODD * anywhere


def _uniform(frequency: float, low: float, high: float) -> float:
    return 1 / log(high / low) if low <= frequency <= high else 0.0


def _partials(
    frequency: float,
    partials: Sequence[float] | Floats,
    std: float,
    doubt: float,
    weights: Floats | None = None,
) -> float:
    """Return the density about several frequencies; by default they have the same weight."""
    weights = np.ones(len(partials)) if weights is None else weights
    away = np.log(frequency / np.asarray(partials))
    return float(norm.pdf(away, scale=sqrt(std**2 + doubt**2)) @ weights / weights.sum())


def _damping(source: Source, found: Oscillation) -> float:
    """Return the density of the fraction of critical damping."""
    if source not in DAMPING:
        return 1 / MOST_DAMPING
    return 2 * float(norm.pdf(found.damping, scale=np.hypot(DAMPING[source], found.damping_std)))


def _phases(source: Source, found: Oscillation, several: bool) -> float:
    """Return the probability of the phases that show the oscillation, and that do not."""
    likely = 1.0
    for phase, chance in zip(PHASES, SEEN[source], strict=True):
        if phase not in found.seen:
            continue
        if source is Source.STRING and phase == "released" and several:
            chance = AFTER_ANOTHER
        likely *= chance if found.seen[phase] >= 0.5 else 1 - chance
    return likely


def _ratio(source: Source, clearest: Observed) -> float:
    """Return the density of size and phase of the ratio of force to velocity."""
    size, doubt = log10(abs(clearest.ratio)), clearest.ratio_std / log(10)
    parts = [(1.0, *RATIO[source])]
    if source is Source.FINGER:
        parts = [(1 - FLEXIBLE[0], *RATIO[source]), FLEXIBLE]
    law = {"velocity": norm.sf, "force": norm.cdf}.get(clearest.unseen, norm.pdf)
    likely = float(sum(w * law(size, mean, sqrt(std**2 + doubt**2)) for w, mean, std in parts))
    if clearest.unseen:
        return likely / 2
    part = IN_PHASE.get(source, 0.0)
    turned = degrees(float(np.angle(clearest.ratio)))
    wide = degrees(2 * pi * clearest.mode.frequency * DELAY_STD)
    spread = sqrt(IN_PHASE_STD**2 + wide**2 + degrees(clearest.ratio_std) ** 2)
    aligned = _about(turned, 0.0, spread)
    if source is Source.KEY:
        aligned = (aligned + _about(turned, 180.0, spread)) / 2
    return likely * (part * aligned + (1 - part)) / 2


def _about(angle: float, centre: float, spread: float) -> float:
    """Return the density of an angle [deg] on the circle, relative to a uniform one."""
    away = (angle - centre + 180) % 360 - 180
    return 360 * exp(-0.5 * (away / spread) ** 2) / (spread * sqrt(2 * pi))
