"""Acquisitions with samples before their trigger's edge."""

import math

from sautereau.sim_backend.devices.daqmx.card import ENDLESS
from sautereau.sim_backend.devices.daqmx.runs import RunFault, SampledRun
from sautereau.trajectory.motion import Floats


class PreTriggerRun(SampledRun):
    """A pre-trigger acquisition: samples of the bench from its start on, kept around the edge.

    Construct it as a `SampledRun`, then call `begin`.
    """

    def begin(self, time: float | None, before: int) -> None:
        """Sample from a simulated time [s] on; keep ``before`` samples before the edge.

        Without a time a first edge starts the samples, and a later one is that edge.
        """
        self._before = before
        self._first: int | None = None
        if time is not None:
            self._sample_from(time)

    def _sample_from(self, time: float) -> None:
        super().trigger(time)
        self._end = self._before

    @property
    def waiting_for_trigger(self) -> bool:
        """Whether an edge on the trigger's terminal would be accepted."""
        return self._first is None and not self.stopped and not self.unwired

    def waits_for(self, falling: bool) -> bool:
        """Return whether it waits for a rising or a falling edge: its start's, then its own."""
        edge = self._starts_falling if self.trigger_time is None else self._falling
        return self.waiting_for_trigger and edge == falling

    @property
    def over(self) -> bool:
        """Whether no further sample will be acquired."""
        return self.stopped or (self._first is not None and self._done >= self._end)

    def trigger(self, time: float, fault: RunFault | None = None) -> None:
        """Accept an edge at a simulated time [s], if enough samples lie before it."""
        if self._first is not None or self.stopped:
            return
        if self.trigger_time is None:
            self._sample_from(time)
            return
        edge = math.ceil((time - self.trigger_time) * self.rate * (1 - 1e-12))
        if edge < self._before:
            return
        self._first = edge - self._before
        self._fault = fault
        kept = self.n_samples if fault is None else min(fault.sample, self.n_samples)
        self._end = self._first + kept

    @property
    def _readable(self) -> int:
        """All samples once they are complete, none before."""
        complete = self._first is not None and self._done >= self._end
        return self._end - (self._first or 0) if complete else 0

    @property
    def _last(self) -> int:
        """Samples after which no more are taken."""
        return ENDLESS if self._first is None else self._end

    def read(self, first: int, n: int) -> Floats:
        """Return samples [V], counted from the first one kept, shape (n_channels, n)."""
        return super().read(first + (self._first or 0), n)
