"""The true events after each trigger, which no recording holds."""

from bisect import bisect_left
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

    @property
    def release_forces(self) -> tuple[float, ...]:
        """N, of the string on the jack just before each release."""
        return tuple(event.force for event in self.release_events)

    def choir(self, number: int) -> "Truth":
        """Return the events of one choir, 0 for the first one."""
        return Truth(
            *(
                tuple(event for event in events if event.choir == number)
                for events in (self.contact_events, self.release_events, self.return_events)
            )
        )


def truths(events: PluckEvents, edges: list[float]) -> list[Truth]:
    """Return the events from each trigger edge to the next.

    Args:
        events: Of the world so far.
        edges: s, simulated, in order.
    """
    return [
        Truth(
            _between(events.contacts, start, end),
            _between(events.releases, start, end),
            _between(events.returns, start, end),
        )
        for start, end in pairwise([*edges, float("inf")])
    ]


def _between(events: list[StringEvent], start: float, end: float) -> tuple[StringEvent, ...]:
    first, stop = (bisect_left(events, t, key=lambda event: event.time) for t in (start, end))
    return tuple(replace(event, time=event.time - start) for event in events[first:stop])
