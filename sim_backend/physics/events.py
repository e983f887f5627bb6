"""What truly happened on the bench: motion, and what the strings met."""

from dataclasses import dataclass, field

from sautereau.trajectory.motion import Floats


@dataclass(frozen=True)
class StringEvent:
    """A string is met, let go, or passed by the plectrum on its way down."""

    time: float
    """s on the world's clock."""
    choir: int
    """0 for the first one."""
    force: float
    """N, of the string on the jack, downwards: at a release just before it."""


@dataclass
class PluckEvents:
    """The events of all strings so far, in order of time."""

    contacts: list[StringEvent] = field(default_factory=list)
    releases: list[StringEvent] = field(default_factory=list)
    returns: list[StringEvent] = field(default_factory=list)
    """When a falling plectrum has come below its string again."""


@dataclass(frozen=True)
class Motions:
    """What happened in some steps; arrays of shape (n,), the steps need not be even."""

    time: Floats
    """s, end of each step on the world's clock."""
    angle: Floats
    """rad, of the key."""
    spin: Floats
    """rad/s, of the key."""
    rise: Floats
    """m, of the first jack above its rest."""
    finger_force: Floats
    """N, of the finger on the key, normal to it."""
    string_force: Floats
    """N, of all strings on their jacks, downwards; at the end of each step."""
