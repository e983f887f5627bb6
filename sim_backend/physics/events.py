"""Ground truth of a simulation: motion, and the events of the strings."""

from dataclasses import dataclass, field

from sautereau.trajectory.motion import Floats


@dataclass(frozen=True)
class StringEvent:
    """A contact, a release, or a return of the plectrum below its string."""

    time: float
    """s of simulated time."""
    choir: int
    """0 for the first one."""
    force: float
    """N, of the string on the jack, downwards; of a release, just before it."""


@dataclass
class PluckEvents:
    """Events of all strings so far, in order of time."""

    contacts: list[StringEvent] = field(default_factory=list)
    releases: list[StringEvent] = field(default_factory=list)
    returns: list[StringEvent] = field(default_factory=list)
    """Events at which a falling plectrum is below its string again."""


@dataclass(frozen=True)
class Motions:
    """Motion over some steps, which need not be equal; arrays of shape (n,).

    Every event ends a step. Where a quantity jumps there are two equal times: the first has the
    values before the jump, the last those after it.
    """

    time: Floats
    """s of simulated time, end of each step."""
    angle: Floats
    """rad, of the key as the laser sees it: the depth under the spot over its arm."""
    angular_velocity: Floats
    """rad/s, likewise."""
    rise: Floats
    """m, of the first jack above its rest."""
    finger_force: Floats
    """N, of the finger on the key, normal to it."""
    string_force: Floats
    """N, of all strings on their jacks, downwards; at the end of each step."""
