"""When the trigger was by the host's clock, from how many samples a device had acquired."""

import math
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Counted:
    """How many samples a device had acquired at a time between question and answer."""

    asked: float
    """Time before the question, s on `time.perf_counter`; -inf if this gives no earliest date.

    `time.monotonic` has steps of 16 ms in Windows before Python 3.13.
    """
    answered: float
    """Time after the answer, s on the same clock; inf if this gives no latest date."""
    stop: int
    """Index after the last sample acquired, counted from the trigger."""


class TriggerDate:
    """The time of the trigger as counts narrow it down.

    Of each count, the next sample was not yet taken at the question: the trigger is not earlier
    than that. And the last one was taken before the answer: the trigger is not later. If time stops
    for the device, or it counts late, the first statement of a count after the trigger is false,
    and the second one of a count before it. So a count before the trigger limits it below, and one
    after it above. Without a count before it, those after it limit it on both sides. If limits
    contradict each other, what they differ by is added to the uncertainty on both sides, for any
    other count may be false by as much.
    """

    def __init__(self, rate: float):
        """Start without a count, for a sampling rate in Hz."""
        self._rate = rate
        self._cause = -math.inf
        self._counts: list[Counted] = []

    def not_before(self, time: float) -> None:
        """State that the trigger's cause came at ``time`` (s on `time.perf_counter`) or later."""
        self._cause = max(self._cause, time)

    def add(self, counted: Counted) -> None:
        """Use a count."""
        self._counts.append(counted)

    def found(self) -> tuple[float, float | None]:
        """Return the time, s on `time.perf_counter`, and its standard uncertainty, s.

        The time is not before its cause. The uncertainty is None, and the time the latest possible
        one, if no count gives an earliest time.
        """
        before = self._earliest(one for one in self._counts if one.stop <= 0)
        earliest = before or self._earliest(self._counts)
        latest = self._latest(one for one in self._counts if one.stop > 0)
        limit = min(latest or self._latest(self._counts))
        if not earliest:
            return max(limit, self._cause), None
        contradiction = max(0.0, max(*earliest, self._cause) - limit)
        known = [time for time in (*earliest, self._cause) if -math.inf < time <= limit]
        first = max(known, default=limit)
        std = (limit - first + 2 * contradiction) / math.sqrt(12)
        return max((first + limit) / 2, self._cause), std

    def _earliest(self, counts: Iterable[Counted]) -> list[float]:
        times = [one.asked - one.stop / self._rate for one in counts]
        return [time for time in times if time > -math.inf]

    def _latest(self, counts: Iterable[Counted]) -> list[float]:
        return [one.answered - (one.stop - 1) / self._rate for one in counts]
