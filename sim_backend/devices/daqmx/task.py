"""One DAQmx task of the stand-in: its settings, its run, and how far it was read."""

import math
import re
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sautereau.sim_backend.devices.daqmx.card import (
    ENDLESS,
    Card,
    DaqmxError,
    PreTriggerCard,
    Run,
    TaskSetup,
    physical_channels,
)

MAX_RATE = 1e6
"""Hz, fastest sample clock of the stand-in."""
MAX_VOLTAGE = 10.0
"""V, end of the stand-in's only input range."""
ON_DEMAND_RATE = 1000.0
"""Hz, at which reads of a task without a sample clock are timed."""
_SLICE = 0.1
"""s, after which a waiting read checks whether its client is still there."""

FINITE, CONTINUOUS = 10178, 10123
_CURRENT, _FIRST_BEFORE = 10425, 10427
_RISING, _VOLTS = 10280, 10348
_BUFFERS = ((100.0, 1_000), (10e3, 10_000), (1e6, 100_000))
"""Hz and samples: the default buffer of a continuous task up to a rate."""
_TERMINAL_CONFIGURATIONS = (-1, 10083, 10078, 10106, 12529)


@dataclass
class CardTask:
    """A task on a card: channels, timing and trigger, then a run and how far it was read."""

    card: Card
    name: str
    channels: dict[str, str] = field(default_factory=dict)
    """Terminal of each virtual channel, by its name, in order."""
    rate: float | None = None
    """Hz; None without a sample clock."""
    mode: int = FINITE
    n_samples: int = 0
    """Samples of each channel of a finite acquisition; requested buffer of a continuous one."""
    buffer: int | None = None
    """Samples of each channel, as set; None for the driver's default."""
    trigger: str | None = None
    before: int | None = None
    """Samples before the edge of a reference trigger; None where the trigger starts."""
    relative: int = _CURRENT
    """Reference of a read: the last sample read, or the first one before the edge."""
    reserved: bool = False
    """Whether it holds the card without running."""
    run: Run | None = None
    position: int = 0
    """Samples of each channel read so far."""

    def add_voltage(
        self, physical: str, name: str, configuration: int, low: float, high: float, units: int
    ) -> None:
        """Add voltage channels; ``low`` and ``high`` in V."""
        self._must_be_idle()
        terminals = physical_channels(physical, self.card)
        if not -MAX_VOLTAGE <= low < high <= MAX_VOLTAGE:
            raise DaqmxError(
                -200077,
                f"Requested value is not a supported value for this property. Range {low:g} V to"
                f" {high:g} V; possible: {-MAX_VOLTAGE:g} V to {MAX_VOLTAGE:g} V",
            )
        if configuration not in _TERMINAL_CONFIGURATIONS:
            raise DaqmxError(-200077, f"Terminal configuration {configuration} is not supported.")
        if units != _VOLTS:
            raise DaqmxError(-200077, "The stand-in measures in volts only: custom scales refused.")
        names = [f"{name}{n}" for n in range(len(terminals))] if len(terminals) > 1 else [name]
        for given, terminal in zip(names, terminals, strict=True):
            virtual = given if name else f"{self.card.name}/{terminal}"
            if virtual in self.channels or terminal in self.channels.values():
                raise DaqmxError(-200489, f"Channel {virtual} is already in the task.")
            self.channels[virtual] = terminal

    def set_clock(self, source: str, rate: float, mode: int, n_samples: int) -> None:
        """Configure an acquisition on the card's own sample clock; ``rate`` in Hz."""
        self._must_be_idle()
        if mode not in (FINITE, CONTINUOUS):
            raise DaqmxError(
                -200077, f"Sample mode {mode} is not supported: use FINITE or CONTINUOUS."
            )
        if source.lower() not in ("", "onboardclock"):
            raise DaqmxError(
                -200452, f"Sample clock source {source!r} is not supported: use the onboard clock."
            )
        if not 0 < rate <= MAX_RATE:
            raise DaqmxError(
                -200077, f"Sample rate {rate:g} Hz is not supported: 0 to {MAX_RATE:g} Hz."
            )
        if n_samples < 2:
            raise DaqmxError(-200077, f"{n_samples} samples per channel requested: at least 2.")
        self.rate, self.mode, self.n_samples = rate, mode, n_samples

    def set_trigger(self, source: str, edge: int, before: int | None = None) -> None:
        """Start on a rising digital edge, or keep ``before`` samples before it.

        The route is checked when the task starts.
        """
        self._must_be_idle()
        if edge != _RISING:
            raise DaqmxError(-200452, "The stand-in triggers on rising edges only.")
        if before is not None and before < 2:
            raise DaqmxError(-200077, f"{before} pretrigger samples requested: at least 2.")
        self.trigger, self.before = source, before
        if before is not None:
            self.relative = _FIRST_BEFORE

    def remove_trigger(self, *, reference: bool) -> None:
        """Remove the start trigger or the reference trigger, if there is one."""
        self._must_be_idle()
        if reference == (self.before is not None):
            self.trigger = self.before = None
            self.relative = _CURRENT

    def read_from(self, relative: int) -> None:
        """Set the reference of a read."""
        if relative not in (_CURRENT, _FIRST_BEFORE):
            raise DaqmxError(-200077, f"Reading relative to {relative} is not supported.")
        if relative == _FIRST_BEFORE and self.before is None:
            raise DaqmxError(-200282, "Reading relative to a reference trigger needs one.")
        self.relative = relative

    def set_buffer(self, n: int) -> None:
        """Set the buffer to ``n`` samples of each channel."""
        self._must_be_idle()
        if self.rate is not None and self.mode == FINITE and n < self.n_samples:
            raise DaqmxError(
                -200077,
                f"Input buffer of {n} samples is less than the {self.n_samples} of the finite"
                " acquisition.",
            )
        self.buffer = n

    @property
    def length(self) -> int:
        """Samples of each channel; `ENDLESS` for a continuous acquisition."""
        return self.n_samples if self.mode == FINITE else ENDLESS

    @property
    def buffer_size(self) -> int:
        """Samples of each channel that are kept until they are read."""
        if self.buffer is not None or self.mode == FINITE:
            return self.n_samples if self.buffer is None else self.buffer
        least = next((n for rate, n in _BUFFERS if (self.rate or 0) <= rate), _BUFFERS[-1][1])
        return max(least, self.n_samples)

    def start(self) -> None:
        """Arm the card."""
        self._must_be_idle()
        self.check()
        if self.rate is not None:
            self._launch(self.rate, self.length, self._route())

    def check(self) -> None:
        """Refuse a task that cannot start."""
        if not self.channels:
            raise DaqmxError(-200460, "There are no input channels in this task.")
        if self.trigger is not None:
            self._route()
            if self.rate is None:
                raise DaqmxError(-200452, "A trigger needs a sample clock.")
        if self.before is None:
            return
        if not isinstance(self.card, PreTriggerCard):
            raise DaqmxError(-200452, "This device has no reference trigger.")
        if self.mode != FINITE:
            raise DaqmxError(-200358, "A reference trigger needs a finite acquisition.")
        if self.n_samples - self.before < 2:
            raise DaqmxError(
                -200213,
                f"{self.before} pretrigger samples of {self.n_samples} leave less than 2 after"
                " the trigger.",
            )

    def stop(self) -> None:
        """End the run, if any."""
        run, self.run = self.run, None
        if run is not None:
            run.stop()

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
        self, n: int, timeout: float, alive: Callable[[], bool]
    ) -> tuple[NDArray[np.float64], bool]:
        """Return the next samples, shape (n_channels, at most n), and whether they are complete."""
        if n < 0:
            n = self.remaining()
        if implicit := self.run is None:
            self.check()
            if self.rate is None:
                self._launch(ON_DEMAND_RATE, n, None)
            else:
                self.start()
        if self.relative == _FIRST_BEFORE:
            self.position = 0
        try:
            length = n if self.rate is None else self.length
            if self.position + n > length:
                raise DaqmxError(
                    -200278,
                    "Attempted to read a sample beyond the final sample acquired."
                    f" Asked: {self.position + n} samples. Acquired in all: {length}.",
                )
            there = self.wait(self.position + n, timeout, alive)
            run = self.run
            if run is None:
                raise DaqmxError(-200983, "The task was stopped while it was read.")
            self._must_fit(there)
            count = max(0, min(n, there - self.position))
            volts = run.read(self.position, count)
            self.position += count
            return volts, count == n
        finally:
            if implicit and (self.rate is None or self.position == self.length):
                self.stop()

    def _must_fit(self, acquired: int) -> None:
        """Refuse to read samples that later ones have overwritten."""
        unread = acquired - self.position
        if self.mode == CONTINUOUS and self.card.paced and unread > self.buffer_size:
            raise DaqmxError(
                -200279,
                "The application is not able to keep up with the hardware acquisition.\n"
                f"{unread} samples are unread, and the buffer holds {self.buffer_size}.",
            )

    def remaining(self) -> int:
        """Return the samples of each channel that a read of all would return."""
        if self.rate is None:
            return 1
        if self.mode == CONTINUOUS:
            return self.available()
        return self.n_samples - (0 if self.run is None else self.position)

    def available(self) -> int:
        """Return the samples of each channel acquired and not yet read."""
        return 0 if self.run is None else self.run.wait_for(0, 0.0) - self.position

    def acquired(self) -> int:
        """Return the samples of each channel acquired since the start."""
        return self.position if self.run is None else self.run.acquired

    def _launch(self, rate: float, n_samples: int, trigger: str | None) -> None:
        setup = TaskSetup(tuple(self.channels.values()), rate, n_samples, trigger)
        self.position = 0
        if self.before is not None and isinstance(self.card, PreTriggerCard):
            self.run = self.card.start_pretrigger(setup, self.before)
        else:
            self.run = self.card.start(setup)

    def _route(self) -> str | None:
        if self.trigger is None:
            return None
        route = re.fullmatch(r"(?:/(\w+)/)?(PFI\d+)", self.trigger, re.IGNORECASE)
        if not route or (route[1] or self.card.name).lower() != self.card.name.lower():
            raise DaqmxError(
                -89120,
                "Source terminal to be routed could not be found on the device."
                f" Source terminal: {self.trigger}",
            )
        return f"/{self.card.name}/{route[2].upper()}"

    def _must_be_idle(self) -> None:
        if self.run is not None:
            raise DaqmxError(
                -200479, f"Specified operation cannot be performed while {self.name} is running."
            )
