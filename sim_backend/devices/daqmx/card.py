"""The interface between the DAQmx stand-in and a card: its runs, and the driver's errors."""

import re
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray


class DaqmxError(Exception):
    """An error as the driver answers it: its code and text."""

    def __init__(self, code: int, message: str):
        super().__init__(message)
        self.code = code
        self.samples_read: int | None = None
        """Samples of each channel that a failed read returned; None where nothing was read."""


class ServerGone(Exception):  # noqa: N818 - the name says what happened
    """Raised by a card whose server stops: no later call is answered."""


MOST_CHANNELS = 1024
"""Channels that one range may name."""
ENDLESS = 2**62
"""More samples than any acquisition reaches."""


@dataclass(frozen=True)
class TaskSetup:
    """What a task requests of the card when it starts."""

    terminals: tuple[str, ...]
    """Physical channels without the device, in the task's order: ``("ai0", "ai1")``."""
    rate: float
    """Hz, of every channel."""
    n_samples: int
    """Samples of each channel, after which the acquisition ends by itself; `ENDLESS` for a
    continuous one."""
    trigger: str | None
    """Terminal whose rising edge starts the samples, ``"/Dev1/PFI0"``; None starts at once."""


class Run(Protocol):
    """A started acquisition.

    The samples of a pre-trigger acquisition are counted from the first one kept, before the edge,
    and can be read once all of them are acquired.
    """

    @property
    def acquired(self) -> int:
        """Samples of each channel acquired since the start, kept or not."""
        ...

    def wait_for(self, n: int, timeout: float) -> int:
        """Return the number of acquired samples per channel, after waiting for ``n`` of them.

        Returns before ``timeout`` (s of real time) only with ``n`` samples or more, or after
        `stop`. May raise `DaqmxError` or `ServerGone`.
        """
        ...

    def read(self, first: int, n: int) -> NDArray[np.float64]:
        """Return samples ``first`` to ``first + n``: shape (n_channels, n), V."""
        ...

    def stop(self) -> None:
        """End the acquisition; harmless when it has ended."""
        ...


class Card(Protocol):
    """A DAQ device; `start` may raise `DaqmxError`."""

    @property
    def name(self) -> str:
        """Of the device, ``"Dev1"``."""
        ...

    @property
    def terminals(self) -> tuple[str, ...]:
        """Its analog inputs, ``("ai0", "ai1")``; raises `DaqmxError` if it is disconnected."""
        ...

    @property
    def paced(self) -> bool:
        """Whether samples are acquired even if they are not read, so that a buffer can overflow."""
        ...

    def start(self, setup: TaskSetup) -> Run:
        """Arm an acquisition."""
        ...


@runtime_checkable
class PreTriggerCard(Card, Protocol):
    """A DAQ device with a reference trigger, which not all devices have."""

    def start_pretrigger(self, setup: TaskSetup, before: int) -> Run:
        """Start an acquisition that keeps ``before`` samples before its trigger's edge.

        An edge that comes earlier is ignored.
        """
        ...


def physical_channels(text: str, card: Card) -> list[str]:
    """Return the terminals that ``"Dev1/ai0:1, Dev1/ai3"`` names, without the device."""
    known = {terminal.lower(): terminal for terminal in card.terminals}
    found = []
    for part in (part.strip() for part in text.split(",")):
        device, _, terminal = part.rpartition("/")
        if not part:
            raise DaqmxError(-200099, "Physical channel not specified.")
        if device.lstrip("/").lower() != card.name.lower():
            raise DaqmxError(-200220, f"Device identifier is invalid. Device: {device or part}")
        if span := re.fullmatch(r"([A-Za-z]+)(\d+):(?:[A-Za-z]+)?(\d+)", terminal):
            first, last = int(span[2]), int(span[3])
            if abs(last - first) > MOST_CHANNELS:
                raise DaqmxError(-200170, f"More than {MOST_CHANNELS} channels: {part}")
            step = 1 if last >= first else -1
            names = [f"{span[1]}{n}" for n in range(first, last + step, step)]
        else:
            names = [terminal]
        for name in names:
            if name.lower() not in known:
                raise DaqmxError(
                    -200170,
                    "Physical channel specified does not exist on this device.\n"
                    f"Physical Channel Name: {card.name}/{name}",
                )
            found.append(known[name.lower()])
    return found
