"""One DAQmx task of the stand-in: its settings, its run, and how far it was read."""

import math
import re
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sim_backend.daqmx.card import Card, DaqmxError, Run, TaskSetup, physical_channels

MAX_RATE = 1e6
"""Hz, fastest sample clock of the stand-in."""
MAX_VOLTAGE = 10.0
"""V, end of the stand-in's only input range."""
ON_DEMAND_RATE = 1000.0
"""Hz, at which reads of a task without a sample clock are timed."""
_SLICE = 0.1
"""s, after which a waiting read looks whether anyone still wants it."""

_FINITE, _CONTINUOUS, _RISING, _VOLTS = 10178, 10123, 10280, 10348
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
    n_samples: int = 0
    trigger: str | None = None
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
        """Configure a finite acquisition on the card's own sample clock; ``rate`` in Hz."""
        self._must_be_idle()
        if mode != _FINITE:
            what = "Continuous acquisition" if mode == _CONTINUOUS else f"Sample mode {mode}"
            raise DaqmxError(-200077, f"{what} is not built into the stand-in yet: use FINITE.")
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
        self.rate, self.n_samples = rate, n_samples

    def set_trigger(self, source: str, edge: int) -> None:
        """Start on a rising digital edge; the route is checked when the task starts."""
        self._must_be_idle()
        if edge != _RISING:
            raise DaqmxError(-200452, "The stand-in starts on rising edges only.")
        self.trigger = source

    def start(self) -> None:
        """Arm the card."""
        self._must_be_idle()
        self.check()
        if self.rate is not None:
            self._launch(self.rate, self.n_samples, self._route())

    def check(self) -> None:
        """Refuse a task that could not start."""
        if not self.channels:
            raise DaqmxError(-200460, "There are no input channels in this task.")
        if self.trigger is not None:
            self._route()
            if self.rate is None:
                raise DaqmxError(-200452, "A start trigger needs a sample clock.")

    def stop(self) -> None:
        """End the run, if any."""
        run, self.run = self.run, None
        if run is not None:
            run.stop()

    def wait(self, n: int, timeout: float, wanted: Callable[[], bool]) -> int:
        """Return the samples there after waiting for ``n``; ``timeout`` in s, -1 for ever."""
        if timeout < 0 and timeout != -1:
            raise DaqmxError(-200453, f"Timeout {timeout:g} s is not valid: -1, 0 or more.")
        deadline = math.inf if timeout == -1 else time.monotonic() + timeout
        while (run := self.run) is not None:
            left = deadline - time.monotonic()
            there = run.wait_for(n, max(0.0, min(left, _SLICE)))
            if there >= n or left <= 0 or not wanted():
                return there
        raise DaqmxError(-200983, "The task is not running: it was stopped or never started.")

    def read(
        self, n: int, timeout: float, wanted: Callable[[], bool]
    ) -> tuple[NDArray[np.float64], bool]:
        """Return the next samples, shape (n_channels, at most n), and whether that is all."""
        if n < 0:
            n = self.remaining()
        if implicit := self.run is None:
            self.check()
            if self.rate is None:
                self._launch(ON_DEMAND_RATE, n, None)
            else:
                self.start()
        try:
            length = n if self.rate is None else self.n_samples
            if self.position + n > length:
                raise DaqmxError(
                    -200278,
                    "Attempted to read a sample beyond the final sample acquired."
                    f" Asked: {self.position + n} samples. Acquired in all: {length}.",
                )
            there = self.wait(self.position + n, timeout, wanted)
            run = self.run
            if run is None:
                raise DaqmxError(-200983, "The task was stopped while it was read.")
            count = max(0, min(n, there - self.position))
            volts = run.read(self.position, count)
            self.position += count
            return volts, count == n
        finally:
            if implicit and (self.rate is None or self.position == self.n_samples):
                self.stop()

    def remaining(self) -> int:
        """Return the samples of each channel that a read of all would take."""
        if self.rate is None:
            return 1
        return self.n_samples - (0 if self.run is None else self.position)

    def available(self) -> int:
        """Return the samples of each channel acquired and not yet read."""
        return 0 if self.run is None else self.run.wait_for(0, 0.0) - self.position

    def _launch(self, rate: float, n_samples: int, trigger: str | None) -> None:
        terminals = tuple(self.channels.values())
        self.position = 0
        self.run = self.card.start(TaskSetup(terminals, rate, n_samples, trigger))

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
