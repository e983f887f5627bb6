"""Dates that follow from one look at the host's clock."""

from collections.abc import Callable


class SteadyClock:
    """A date that goes on evenly, whatever is done to the host's clock meanwhile."""

    def __init__(self, clock: Callable[[], int], monotonic: Callable[[], float]):
        """Look at the host's clock.

        Args:
            clock: ns since 1970.
            monotonic: s, of a clock that is never set.
        """
        self._monotonic = monotonic
        self._began = monotonic()
        self._began_ns = clock()

    def seconds(self) -> float:
        """Return s since the look."""
        return self._monotonic() - self._began

    def now_ns(self) -> int:
        """Return ns since 1970."""
        return self._began_ns + round(self.seconds() * 1e9)
