"""The true events after each trigger, which no recording holds."""

from dataclasses import dataclass, replace
from itertools import pairwise

from sautereau.sim_backend.physics.events import PluckEvents, StringEvent


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
