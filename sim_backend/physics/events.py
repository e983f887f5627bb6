"""Ground truth of a simulation: motion, and the events of the strings."""

from dataclasses import dataclass, field, replace
from itertools import pairwise

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
    blow: Floats
    """N, besides `finger_force`: the impulse of the finger's impacts on the key as a force over a
    step; in the exact engine a constant over the undivided step after it."""


@dataclass(frozen=True)
class Truth:
    """The true events after one trigger edge; times in s from it."""

    contact_events: tuple[StringEvent, ...]
    """Contacts, in order of time."""
    release_events: tuple[StringEvent, ...]
    """Releases."""
    return_events: tuple[StringEvent, ...]
    """Returns of plectra below their strings."""

    @property
    def contacts(self) -> tuple[float, ...]:
        """s from the edge, contacts of all choirs."""
        return tuple(event.time for event in self.contact_events)

    @property
    def releases(self) -> tuple[float, ...]:
        """s from the edge, releases of all choirs."""
        return tuple(event.time for event in self.release_events)

    @property
    def returns(self) -> tuple[float, ...]:
        """s from the edge, when falling plectra had passed their strings."""
        return tuple(event.time for event in self.return_events)


def truths(events: PluckEvents, edges: list[float]) -> list[Truth]:
    """Return the events from each trigger edge to the next.

    Args:
        edges: s, simulated, in order.
    """
    kinds = events.contacts, events.releases, events.returns
    found = []
    for start, end in pairwise([*edges, float("inf")]):
        between = ([e for e in kind if start <= e.time < end] for kind in kinds)
        found.append(Truth(*(tuple(replace(e, time=e.time - start) for e in b) for b in between)))
    return found
