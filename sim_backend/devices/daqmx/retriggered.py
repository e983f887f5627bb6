"""Acquisitions that every edge of the start trigger starts again."""

from dataclasses import replace

import numpy as np

from sautereau.sim_backend.devices.daqmx.card import ENDLESS, TaskSetup
from sautereau.sim_backend.devices.daqmx.runs import RunFault, SampledRun, Wiring
from sautereau.sim_backend.physics.events import Motions
from sautereau.trajectory.motion import Floats


class RetriggeredRun(SampledRun):
    """Parts of equally many samples, one for each edge; their samples are counted together.

    An edge during a part is ignored. Arguments as of `SampledRun`; the setup's `per_trigger` is the
    length of a part.
    """

    def __init__(self, wiring: Wiring, setup: TaskSetup, number: int, rest: Motions | None = None):
        super().__init__(wiring, setup, number, rest)
        self._first = 0
        self._length = length = setup.per_trigger or 0
        self._of_each_part = wiring, replace(setup, n_samples=length, buffer=ENDLESS), number
        self._rest = rest
        self._runs: list[SampledRun] = []
        self._dropped_parts = 0

    @property
    def waiting_for_time(self) -> bool:
        if self._paced:
            return super().waiting_for_time
        return bool(self._runs) and self._runs[-1].waiting_for_time and not self.over

    @property
    def waiting_for_trigger(self) -> bool:
        """Whether an edge on the trigger's terminal would start a part."""
        between = not self._runs or self._runs[-1].over
        return between and not self.over and not self.unwired

    def trigger(self, time: float, fault: RunFault | None = None) -> None:
        """Start a part at a simulated time [s], unless one is being acquired."""
        if not self.waiting_for_trigger:
            return
        wiring, setup, number = self._of_each_part
        number += (self._dropped_parts + len(self._runs)) << 32
        self._runs.append(SampledRun(wiring, setup, number, self._rest))
        self._runs[-1].trigger(time)
        if fault is not None and fault.sample < self._length:
            self._end = self._done + fault.sample
            self._fault = RunFault(self._end, fault.error)

    def feed(self, motions: Motions) -> None:
        self._rest = motions
        if self._runs:
            self._runs[-1].feed(motions)
            before = (self._dropped_parts + len(self._runs) - 1) * self._length
            self._done = min(self._end, before + self._runs[-1]._done)

    def read(self, first: int, n: int) -> Floats:
        """Return samples first to first + n [V], shape (n_channels, n); drop earlier parts."""
        with self._lock:
            stop, pieces = min(first + n, self._done), [self._volts]
            drop = max(0, min(first // self._length - self._dropped_parts, len(self._runs) - 1))
            del self._runs[:drop]
            self._dropped_parts += drop
        while first < stop:
            part, at = divmod(first, self._length)
            count = min(self._length - at, stop - first)
            pieces.append(self._runs[part - self._dropped_parts].read(at, count))
            first += count
        return np.concatenate(pieces, axis=1)
