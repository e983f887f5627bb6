"""The interface between the DAQmx stand-in and a card: its runs, and the driver's errors."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sautereau.sim_backend.device_types import DeviceType
from sautereau.sim_backend.sensors.chain import Converter

ENDLESS = 2**62  # More samples than any acquisition reaches
MOST_CHANNELS = 1024  # Channels that one range may name
_SPAN = re.compile(r"(.*?)(\d+):(?:.*?)(\d+)")


class ServerGone(Exception):  # noqa: N818 - the name says what happened
    """Raised by a card whose server stops: no later call is answered."""


class DaqmxError(Exception):
    """An error as the driver answers it: its code and text."""

    def __init__(self, code: int, message: str):
        super().__init__(message)
        self.code = code
        self.samples_read: int | None = None
        """Samples of each channel that a failed read returned; None where nothing was read."""


@dataclass(frozen=True)
class TaskSetup:
    """What a task requests of the card when it starts."""

    terminals: tuple[str, ...]
    """Physical channels, in the task's order: ``("Dev1/ai0", "Dev1/ai1")``."""
    rate: float
    """Hz, of every channel."""
    n_samples: int
    """Samples of each channel, after which the acquisition ends by itself; `ENDLESS` for a
    continuous one."""
    trigger: str | None
    """Terminal whose edge starts the samples, ``"/Dev1/PFI0"``; None starts at once. Of a
    pre-trigger acquisition: of the edge around which samples are kept."""
    before: int | None = None
    """Samples before the edge of a pre-trigger acquisition, for which an earlier edge is ignored;
    None for another one."""
    start_trigger: str | None = None
    """Terminal of an edge that starts a pre-trigger acquisition; None starts it at once."""
    falling: tuple[bool, bool] = (False, False)
    """Whether the edge of `trigger`, and that of `start_trigger`, is a falling one."""
    lags: tuple[float, ...] | None = None
    """s, by which the samples of each channel lag its terminal; None for no lags."""
    converters: tuple[Converter, ...] | None = None
    """Converter of each channel; None for an ideal card."""
    limits: tuple[tuple[float, float], ...] | None = None
    """V, lowest and highest requested of each channel, for a card that makes a signal of them."""
    per_trigger: int | None = None
    """Samples of each channel after every edge of `trigger`; None if only the first one counts."""
    buffer: int = ENDLESS
    """Samples of each channel that may be unread before a paced acquisition ends."""


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


@dataclass(frozen=True)
class Module:
    """One device in the driver's sense: a card, or a module of a chassis."""

    name: str
    """As in NI MAX: ``Dev1``."""
    device: DeviceType
    terminals: tuple[str, ...]
    """Its analog inputs, ``("ai0", "ai1")``."""


class Card(Protocol):
    """The DAQ devices of a bench, whose inputs one task may have.

    `start` and `check` may raise `DaqmxError`.
    """

    @property
    def modules(self) -> tuple[Module, ...]:
        """Its devices: one card, or the modules of the chassis by their slots."""
        ...

    @property
    def chassis(self) -> str:
        """Name of the chassis that holds them; empty where there is none."""
        ...

    def check(self) -> None:
        """Raise `DaqmxError` if it is disconnected."""
        ...

    @property
    def paced(self) -> bool:
        """Whether samples are acquired even if they are not read, so that a buffer can overflow."""
        ...

    def start(self, setup: TaskSetup) -> Run:
        """Arm an acquisition."""
        ...


def owner_of(card: Card) -> str:
    """Return the name of the device that has a card's trigger terminals."""
    return card.chassis or card.modules[0].name


def module_of(card: Card, name: str) -> Module:
    """Return the device of a name.

    Raises:
        DaqmxError: There is none, or the card is disconnected.
    """
    card.check()
    for module in card.modules:
        if module.name.lower() == name.lstrip("/").lower():
            return module
    raise DaqmxError(-200220, f"Device identifier is invalid. Device: {name}")


def split_names(text: str) -> Iterable[str]:
    """Yield the names of a list with ranges: ``"a, b0:2"`` has a, b0, b1, b2."""
    for part in (part.strip() for part in text.split(",")):
        span = _SPAN.fullmatch(part)
        if not span:
            yield part
            continue
        first, last = int(span[2]), int(span[3])
        if abs(last - first) > MOST_CHANNELS:
            raise DaqmxError(-200170, f"More than {MOST_CHANNELS} channels: {part}")
        step = 1 if last >= first else -1
        for number in range(first, last + step, step):
            yield f"{span[1]}{number}"


def physical_channels(text: str, card: Card) -> list[tuple[Module, str]]:
    """Return device and terminal of each input that ``"Dev1/ai0:1, Dev1/ai3"`` names."""
    found = []
    for part in split_names(text):
        device, _, terminal = part.rpartition("/")
        if not part:
            raise DaqmxError(-200099, "Physical channel not specified.")
        module = module_of(card, device or part)
        known = {terminal.lower(): terminal for terminal in module.terminals}
        if terminal.lower() not in known:
            raise DaqmxError(
                -200170,
                "Physical channel specified does not exist on this device.\n"
                f"Physical Channel Name: {module.name}/{terminal}",
            )
        found.append((module, known[terminal.lower()]))
    return found
