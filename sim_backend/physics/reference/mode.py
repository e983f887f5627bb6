"""Which of the bench's inequalities hold as equalities for a while."""

from dataclasses import dataclass
from enum import IntEnum

from sautereau.sim_backend.physics.reference.jack import StringState


class JackMode(IntEnum):
    """What a jack does; those in the air have the sign of their speed."""

    FALLS = -1
    HANGS = 0
    """Held in its register by friction, off the key."""
    RISES = 1
    STANDS = 2
    """On the key."""


class Felt(IntEnum):
    """What the front felt does."""

    OFF = 0
    PRESSED = 1
    SLACK = 2
    """Pressed, but the key leaves it faster than it follows."""


@dataclass(frozen=True)
class Mode:
    """One smooth set of equations."""

    slip: int
    """Sign of the key's speed, for its friction; 0 where it stands."""
    rail: bool
    """Whether it stands on the back rail."""
    touch: bool
    """Whether the fingertip touches it."""
    jacks: tuple[JackMode, ...]


@dataclass(frozen=True)
class Meeting:
    """What each string, each damper and the felt are doing."""

    strings: tuple[StringState, ...]
    damped: tuple[bool, ...]
    felt: Felt
