"""The run of a task, and how far it was read."""

import math
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sautereau.sim_backend.devices.daqmx.card import ENDLESS, Card, PreTriggerCard, Run, TaskSetup
from sautereau.sim_backend.devices.daqmx.driver_errors import DaqmxError

ON_DEMAND_RATE = 1000.0
"""Hz, at which reads of a task without a sample clock are timed."""
_SLICE = 0.1
"""s, after which a waiting read checks whether its client is still there."""
FIRST, CURRENT, REFERENCE, FIRST_BEFORE, MOST_RECENT = REFERENCES = tuple(range(10424, 10429))
"""What a read is relative to."""
_CONTINUOUS = 10123


class Configured(Protocol):
    """A task's settings, as its run needs them; `CardTask` says what they are."""

    card: Card
    mode: int
    n_samples: int
    before: int
    offset: int

    @property
    def rate(self) -> float | None: ...
    @property
    def length(self) -> int: ...
    @property
    def buffer_size(self) -> int: ...
    @property
    def relative(self) -> int: ...
    @property
    def keeps_before(self) -> bool: ...
    def setup(self, rate: float, n_samples: int) -> TaskSetup: ...
    def verify(self) -> None: ...
    def must_be_idle(self) -> None: ...


class Progress:
    """What a task has acquired and read."""

    def __init__(self, task: Configured):
        self._task = task
        self.run: Run | None = None
        self.started = 0.0
        """s since 1970, when the last run was started."""
        self.position = 0
        """Samples of each channel read so far."""
        self._oldest = 0
        """Number of the first sample that a card keeps."""

    def start(self) -> None:
        """Arm the card; without a sample clock nothing happens until a read."""
        task = self._task
        task.must_be_idle()
        task.verify()
        if task.rate is not None:
            self._launch(task.rate, task.length)

    def stop(self) -> None:
        """End the run, if any."""
        run, self.run = self.run, None
        if run is not None:
            run.stop()

    @property
    def done(self) -> bool:
        """Whether the acquisition is complete, or none is running."""
        run = self.run
        return run is None or run.wait_for(0, 0.0) >= self._task.length

    def wait(self, n: int, timeout: float, alive: Callable[[], bool]) -> int:
        """Return the number of samples after waiting for ``n``; ``timeout`` in s, -1 for ever."""
        if timeout < 0 and timeout != -1:
            raise DaqmxError(-200453, f"Timeout {timeout:g} s is not valid: -1, 0 or more.")
        deadline = math.inf if timeout == -1 else time.monotonic() + timeout
        while (run := self.run) is not None:
            left = deadline - time.monotonic()
            there = run.wait_for(n, max(0.0, min(left, _SLICE)))
            if there >= n or left <= 0 or not alive():
                return there
        raise DaqmxError(-200983, "The task is not running: it was stopped or never started.")

    def read(
        self,
        n: int,
        timeout: float,
        alive: Callable[[], bool],
        holding: AbstractContextManager[None],
    ) -> tuple[NDArray[np.float64], bool]:
        """Return the next samples [V], shape (n_channels, at most n), and whether all are there.

        Of a finite acquisition with fewer left than ``n``, those are all. A task that is not
        running is started, ``holding`` the card meanwhile.
        """
        task = self._task
        if n < 0:
            n = self.remaining()
        if implicit := self.run is None:
            task.verify()
            with holding:
                if task.rate is None:
                    self._launch(ON_DEMAND_RATE, n)
                else:
                    self.start()
        self._move()
        length = n if task.rate is None else task.length
        try:
            if self.position >= length and n:
                raise DaqmxError(
                    -200278,
                    "Attempted to read a sample beyond the final sample acquired."
                    f" Acquired in all: {length}.",
                )
            n = min(n, length - self.position)
            there = self.wait(self.position + n, timeout, alive)
            run = self.run
            if run is None:
                raise DaqmxError(-200983, "The task was stopped while it was read.")
            self._must_fit(there)
            count = max(0, min(n, there - self.position))
            volts = run.read(self.position, count)
            if length == ENDLESS:
                self._oldest = self.position
            self.position += count
            return volts, count == n
        finally:
            if implicit and (task.rate is None or self.position == length):
                self.stop()

    def _move(self) -> None:
        """Go to where a read starts."""
        task = self._task
        if task.relative == CURRENT and not task.offset:
            return
        starts = {CURRENT: self.position, REFERENCE: task.before, MOST_RECENT: self._there()}
        start = starts.get(task.relative, 0) + task.offset
        if start < self._oldest:
            raise DaqmxError(-200277, f"Sample {start} is before the first one that is kept.")
        self.position = start

    def _there(self) -> int:
        return 0 if self.run is None else self.run.wait_for(0, 0.0)

    def _must_fit(self, acquired: int) -> None:
        """Refuse to read samples that later ones have overwritten."""
        task = self._task
        unread = acquired - self.position
        endless = task.rate is not None and task.mode == _CONTINUOUS
        if endless and task.card.paced and unread > task.buffer_size:
            raise DaqmxError(
                -200279,
                "The application is not able to keep up with the hardware acquisition.\n"
                f"{unread} samples are unread, and the buffer holds {task.buffer_size}.",
            )

    def remaining(self) -> int:
        """Return the samples of each channel that a read of all would return."""
        task = self._task
        if task.rate is None:
            return 1
        if task.mode == _CONTINUOUS:
            return self.available()
        return task.n_samples - (0 if self.run is None else self.position)

    def available(self) -> int:
        """Return the samples of each channel acquired and not yet read."""
        return 0 if self.run is None else self._there() - self.position

    def acquired(self) -> int:
        """Return the samples of each channel acquired since the start."""
        return self.position if self.run is None else self.run.acquired

    def _launch(self, rate: float, n_samples: int) -> None:
        task = self._task
        self._oldest = 0
        setup = task.setup(rate, n_samples)
        self.started = time.time()
        self.position = 0
        if task.keeps_before and isinstance(task.card, PreTriggerCard):
            self.run = task.card.start_pretrigger(setup, task.before)
        else:
            self.run = task.card.start(setup)
