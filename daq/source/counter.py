"""Count the samples that a task has acquired: their number dates the trigger."""

import math
import time
from dataclasses import replace
from typing import Any

from sautereau.daq.errors import DaqError
from sautereau.daq.file.trigger_date import Counted
from sautereau.daq.source.driver_faults import NOT_DONE
from sautereau.daq.source.task import TaskPlan

PERIOD = 2e-3
"""Interval of polling while samples around the trigger are awaited, s: a start trigger lies between
two polls."""
DATING = 0.05
"""Largest time in s between the trigger and the counts that date it: several polls. The clocks of
host and device differ by about 50 ppm, in this time by less than a sample."""


class SampleCounter:
    """Counts the samples of a nidaqmx task."""

    def __init__(self, task: Any, plan: TaskPlan):
        self._task, self._plan = task, plan
        self._counts: list[Counted] = []

    def count(self) -> Counted:
        """Return the samples acquired since the start."""
        asked = time.monotonic()
        acquired = self._task.in_stream.total_samp_per_chan_acquired
        answered = time.monotonic()
        if self._plan.total is not None and acquired >= self._plan.total and not self._plan.before:
            asked = -math.inf  # it does not say how long ago the last one was acquired
        return Counted(asked, answered, acquired)

    def start(self) -> None:
        """Start the task."""
        asked = time.monotonic()
        self._task.start()
        self._counts = [Counted(asked, math.inf, 0)]

    def await_first(self) -> tuple[Counted, ...]:
        """Wait for the first sample after the edge, at most ``daq.trigger_timeout``.

        Returns:
            The last count without a sample, if any, and the first one with samples, if any.
        """
        if self._plan.triggered:
            end = time.monotonic() + self._plan.daq.trigger_timeout
            while (found := self.count()).stop == 0 and found.answered < end:
                self._counts = [found]
                time.sleep(PERIOD)
            self._counts.append(found)
        return tuple(self._counts)

    def await_pre_trigger(self) -> None:
        """Wait until the samples before the edge are acquired.

        Raises:
            DaqError: They are not within ``daq.trigger_timeout``.
        """
        daq, before = self._plan.daq, self._plan.before
        longest = daq.pre_trigger + daq.trigger_timeout
        end = time.monotonic() + longest
        while (held := self._counts[-1].stop) < before:
            if time.monotonic() > end:
                raise DaqError(
                    f"DAQ device {daq.device}: {held} samples after {longest:g} s, but"
                    f" daq.pre_trigger needs {before}; check whether the device is still plugged in"
                )
            time.sleep(PERIOD)
            self._counts.append(self.count())

    def await_all(self, longest: float) -> tuple[Counted, ...]:
        """Wait for the last sample; with a pre-trigger the driver returns no sample earlier.

        Args:
            longest: Longest wait, s.

        Returns:
            Counts during the wait, relative to the edge, which precedes the last sample by the
            requested number of samples; empty if there was no edge.
        """
        after, not_done = self._plan.after or 0, -math.inf
        end = (asked := time.monotonic()) + longest
        while not self._done():
            if asked > end:
                return ()
            not_done = asked
            self._counts.append(self.count())
            asked = time.monotonic()
        done = Counted(-math.inf, time.monotonic(), after)
        edge = self.count().stop - after
        if edge <= self._plan.before:  # it may not count the samples that it drops
            return done, Counted(not_done, math.inf, after - 1)
        since_edge = [replace(one, stop=one.stop - edge) for one in self._counts]
        first, limit = since_edge[0].stop, DATING * self._plan.daq.sample_rate
        last_before = max((one.stop for one in since_edge if one.stop <= 0), default=first)
        near = (one for one in since_edge if min(-limit, last_before) <= one.stop <= limit)
        return (done, *near)

    def _done(self) -> bool:
        """Return whether the last sample is acquired, after waiting `PERIOD` for it."""
        from nidaqmx.errors import DaqError as DriverError

        try:
            self._task.wait_until_done(PERIOD)
        except DriverError as error:
            if error.error_code != NOT_DONE:
                raise
            return False
        return True
