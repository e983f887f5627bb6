"""The interface between the DAQmx stand-in and a card: runs, inputs, and the driver's errors."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from nidaqmx._stubs import nidaqmx_pb2 as pb
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from sautereau.sim_backend.device_types import IDEAL, DeviceType
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
    chassis: str = ""
    """Name of the chassis that holds it; empty where there is none."""

    @property
    def owner(self) -> str:
        """Name of the device that has its trigger terminals."""
        return self.chassis or self.name

    @property
    def clock(self) -> str:
        """Name of the device whose clock samples it; empty if an ideal one may have any."""
        if self.device is not IDEAL:
            return self.owner
        return chassis_in(self.name) or (self.name if self.name.startswith("Dev") else "")


def chassis_in(name: str) -> str:
    """Return the chassis in a default name of NI MAX, cDAQ1 in cDAQ1Mod2; empty without one."""
    module = re.fullmatch(r"(.+)Mod\d+", name)
    return module[1] if module else ""


class Card(Protocol):
    """The DAQ devices of a bench, whose inputs one task may have.

    `start` and `check` may raise `DaqmxError`.
    """

    @property
    def modules(self) -> tuple[Module, ...]:
        """Its devices: cards, or the modules of a chassis by their slots."""
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


REMOVE_FILTER_DELAY = pb.CHANNEL_ATTRIBUTE_AI_REMOVE_FILTER_DELAY
LINEAR = (0.0, 1.0), (0.0, 1.0)
"""Polynomials of a channel in volts: its units of volts, and the inverse."""
INTERNAL, NO_EXCITATION = 10200, 10230  # Sources of an excitation


@dataclass
class Input:
    """One channel; attributes that nothing computes are kept in ``stored`` as they were set."""

    module: Module
    terminal: str
    """Without the device: ``ai0``."""
    low: float
    """Requested, in the channel's unit."""
    high: float
    configuration: int = -1
    measurement: int = 10322
    """What it measures: voltage, force, ..."""
    forward: tuple[float, ...] = LINEAR[0]
    """Units of the channel as a polynomial of the volts, of its sensor or its custom scale: the
    coefficients from degree 0 up."""
    reverse: tuple[float, ...] = LINEAR[1]
    """Volts as a polynomial of the units."""
    custom_scale: str = ""
    """Its name; empty without one."""
    requested_range: float | None = None
    """V, that the device's range must take, of either sign; None for the limits themselves."""
    stored: dict[int, Any] = field(default_factory=dict)

    @property
    def device(self) -> DeviceType:
        """Type of its device."""
        return self.module.device

    @property
    def physical(self) -> str:
        """Complete name of its terminal: ``Dev1/ai0``."""
        return f"{self.module.name}/{self.terminal}"

    def verify(self) -> None:
        """Refuse what the device cannot do."""
        self.range  # noqa: B018 - raises
        if self.configuration not in (-1, *self.device.configurations):
            raise invalid(
                "AI.TermCfg", self.configuration, f"one of {self.device.configurations}", self
            )

    @property
    def range(self) -> float:
        """Largest magnitude of the device's input range, V."""
        volts = abs(self.requested_range or max(self.limits, key=abs))
        # 1e-9: sensitivity times maximum may exceed a range by rounding only.
        found = self.device.range_for(volts * (1 - 1e-9), self.configuration)
        if not self.low < self.high or found is None:
            limits = f"-{self.device.ranges[-1]:g} V to {self.device.ranges[-1]:g} V"
            raise invalid("AI.Min, AI.Max", f"{self.low:g} to {self.high:g}", limits, self)
        return found

    @property
    def limits(self) -> tuple[float, float]:
        """Requested lowest and highest value, V."""
        if math.isnan(self.low + self.high):
            raise DaqmxError(-200695, f"Set the limits of {self.physical}, which were reset.")
        low, high = sorted(map(float, polyval(np.array([self.low, self.high]), self.reverse)))
        return low, high

    def removed_delay(self, rate: float) -> float:
        """Return how much of its filter's delay the driver removes, s, at a rate [Hz]."""
        samples, seconds = self.device.filter_delay
        return samples / rate + seconds if self.stored.get(REMOVE_FILTER_DELAY) else 0.0

    @property
    def bits(self) -> int:
        """Resolution of its converter."""
        return self.device.bits_of(self.configuration)

    @property
    def step(self) -> float:
        """Volts per count, V; counts are justified to the right."""
        return 2 * self.range / 2**self.bits

    def scaled(self, volts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return volts in the channel's unit."""
        return (
            volts if self.forward == LINEAR[0] else np.asarray(polyval(volts, self.forward), float)
        )

    def counts(self, volts: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the integers that the converter gives for volts."""
        half = 2 ** (self.bits - 1)
        return np.clip(np.rint(volts / self.step), -half, half - 1).astype(np.int64)


def invalid(name: str, value: object, possible: str, who: Input | None = None) -> DaqmxError:
    """Return the driver's error for a value that a property cannot have."""
    channel = f"\nChannel: {who.physical}" if who else ""
    return DaqmxError(
        -200077,
        "Requested value is not a supported value for this property.\n"
        f"Property: {name}\nRequested Value: {value}\nPossible: {possible}{channel}",
    )
