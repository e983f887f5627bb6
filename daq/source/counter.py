"""Count the samples that a task has acquired: their number dates the trigger."""

import math
import time
from dataclasses import replace
from typing import Any

from sautereau.daq.errors import DaqError
from sautereau.daq.file.trigger_date import Counted
from sautereau.daq.source.driver_faults import NOT_DONE
from sautereau.daq.source.task import TaskPlan

PERIOD = 5e-3
"""Interval of polling for the samples before the trigger, s."""
AGAIN = 1.0
"""Interval in s of counting samples while waiting for the edge: clocks differ by 50 ppm."""


class SampleCounter:
    """Counts the samples of a nidaqmx task."""

    def __init__(self, task: Any, plan: TaskPlan):
        self._task, self._plan = task, plan
        self._counts: list[Counted] = []

    def count(self, least: int = 0) -> Counted:
        """Return the samples acquired since the start, at least ``least``."""
        asked = time.monotonic()
        acquired = max(least, self._task.in_stream.total_samp_per_chan_acquired)
        answered = time.monotonic()
        if self._plan.total is not None and acquired >= self._plan.total and not self._plan.before:
            asked = -math.inf  # it does not say how long ago the last one was acquired
        return Counted(asked, answered, acquired)

    def await_pre_trigger(self) -> None:
        """Wait until the samples before the edge are acquired.

        Raises:
            DaqError: They are not within ``daq.trigger_timeout``.
        """
        daq, before = self._plan.daq, self._plan.before
        longest = daq.pre_trigger + daq.trigger_timeout
        end = time.monotonic() + longest
        self._counts = [self.count()]
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
        from nidaqmx.errors import DaqError as DriverError

        end = time.monotonic() + longest
        while (left := end - time.monotonic()) > 0:
            try:
                self._task.wait_until_done(min(left, AGAIN))
            except DriverError as error:
                if error.error_code != NOT_DONE:
                    raise
                self._counts.append(self.count())
                continue
            after = self._plan.after or 0
            done = Counted(-math.inf, time.monotonic(), after)
            edge = self.count().stop - after
            if edge < self._plan.before:  # it does not count the samples that it drops
                return (done,)
            return (done, *(replace(one, stop=one.stop - edge) for one in self._counts))
        return ()
