"""When the trigger was by the host's clock, from how many samples a device had acquired."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Counted:
    """How many samples a device had acquired at a time between question and answer."""

    asked: float
    """Time before the question, s on `time.monotonic`; -inf if this gives no earliest date."""
    answered: float
    """Time after the answer, s on the same clock."""
    stop: int
    """Index after the last sample acquired, counted from the trigger."""


class TriggerDate:
    """The time of the trigger as counts narrow it down.

    The last counted sample was taken before the answer, and the next one was not yet taken at
    the question. If a device delivers its samples late, the second statement is false. An
    earliest time after the latest one is therefore ignored.
    """

    def __init__(self, rate: float):
        """Start without a count, for a sampling rate in Hz."""
        self._rate = rate
        self._latest = math.inf
        self._earliest: list[float] = []

    def add(self, counted: Counted) -> None:
        """Use a count."""
        self._latest = min(self._latest, counted.answered - (counted.stop - 1) / self._rate)
        self._earliest.append(counted.asked - counted.stop / self._rate)

    def found(self) -> tuple[float, float | None]:
        """Return the time, s on `time.monotonic`, and its standard uncertainty, s.

        The uncertainty is None, and the time the latest possible one, if nothing gives an
        earliest time.
        """
        earliest = max((t for t in self._earliest if t <= self._latest), default=-math.inf)
        if earliest == -math.inf:
            return self._latest, None
        return (earliest + self._latest) / 2, (self._latest - earliest) / math.sqrt(12)
