"""Discrete modes: which inequalities of the bench are active as equalities."""

from dataclasses import dataclass
from enum import IntEnum

from sautereau.sim_backend.physics.reference.jack import StringMode


class JackMode(IntEnum):
    """Mode of a jack; in flight it has the sign of the speed."""

    FALLS = -1
    HANGS = 0
    """Held in its register by friction, off the key."""
    RISES = 1
    STANDS = 2
    """On the key."""


class Felt(IntEnum):
    """Mode of the front felt."""

    OFF = 0
    PRESSED = 1
    SLACK = 2
    """Compressed without force: the key leaves it faster than it expands."""


@dataclass(frozen=True)
class Mode:
    """One mode, with smooth equations of motion."""

    slip: int
    """Sign of the key's velocity, for its friction; 0 at rest."""
    rail: bool
    """Whether it rests on the back rail."""
    touching: bool
    """Whether the fingertip touches it."""
    jacks: tuple[JackMode, ...]


@dataclass(frozen=True)
class ForceModes:
    """Modes of the force laws: strings, dampers and felt."""

    strings: tuple[StringMode, ...]
    damped: tuple[bool, ...]
    felt: Felt
