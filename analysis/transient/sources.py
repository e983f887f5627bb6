"""The parts of the bench that can oscillate, what is expected of each, and what separates them."""

from dataclasses import dataclass
from enum import StrEnum


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


MODELS = {
    Source.STRING: SourceModel(
        prior=0.2, seen=(0.01, 0.03, 0.85, 0.05), ratio=-0.1, ratio_std=0.6, damping_std=0.02
    ),
    Source.KEY: SourceModel(
        prior=0.2,
        seen=(0.05, 0.6, 0.75, 0.85),
        ratio=-0.2,
        ratio_std=0.7,
        band=(60.0, 4000.0),
        in_phase=0.8,
    ),
    Source.FINGER: SourceModel(
        prior=0.2,
        seen=(0.1, 0.7, 0.75, 0.75),
        ratio=0.0,
        ratio_std=0.12,
        band=(20.0, 2000.0),
        in_phase=0.95,
    ),
    Source.TRANSDUCER: SourceModel(
        prior=0.2, seen=(0.05, 0.5, 0.6, 0.7), ratio=1.0, ratio_std=0.4, band=(700.0, 20000.0)
    ),
    Source.MAINS: SourceModel(
        prior=0.1, seen=(0.9, 0.9, 0.9, 0.9), ratio=1.0, ratio_std=1.0, damping_std=0.002
    ),
    Source.OTHER: SourceModel(
        prior=0.1, seen=(0.2, 0.3, 0.3, 0.3), ratio=0.0, ratio_std=0.8, band=(20.0, 20000.0)
    ),
}
DECIDING_PRESS = {
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
"""Which press would decide between two sources."""
HUM = "a recording at rest with the drives off: only the hum remains"
"""Which recording would decide between mains hum and another source."""
AGAIN = "more presses at the same speed: a mode of the bench returns at the same frequency"
"""Which presses would decide whether an oscillation belongs to the bench."""
