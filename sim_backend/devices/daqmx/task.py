"""The settings of a DAQmx task of the stand-in, verified before it runs."""

import re
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from sautereau.sim_backend.device_types import IDEAL, DeviceType
from sautereau.sim_backend.devices.daqmx.attributes import number
from sautereau.sim_backend.devices.daqmx.card import (
    ENDLESS,
    Card,
    DaqmxError,
    Input,
    Module,
    Run,
    TaskSetup,
    invalid,
    physical_channels,
    split_names,
)
from sautereau.sim_backend.sensors.chain import Converter

NONE, DIGITAL_EDGE, ANALOG_EDGE, ANALOG_WINDOW = 10230, 10150, 10099, 10103  # Types of a trigger
RISING, FALLING = 10280, 10171


@dataclass
class Trigger:
    """One trigger; sources and slopes are those of its type."""

    kind: int = NONE
    source: str = ""
    edge: int = RISING

    def verify(self, module: Module) -> None:
        """Refuse what the device, or the stand-in, cannot do."""
        if self.kind == NONE:
            return
        if self.kind != DIGITAL_EDGE:
            raise DaqmxError(
                -200452,
                "The stand-in has no analog comparator: analog triggers can be configured, not"
                " started. Use a digital edge.",
            )
        if self.edge not in (RISING, FALLING):
            raise invalid("DigEdge.Edge", self.edge, "rising or falling")
        self.route(module)

    def route(self, module: Module) -> str:
        """Return the complete name of its source: ``/Dev1/PFI0``.

        Raises:
            DaqmxError: The device has no such terminal.
        """
        return terminal(self.source, module)


EXPORTS = {
    12484: "AI_CONV_CLK_OUTPUT_TERM",
    12487: "SAMP_CLK_OUTPUT_TERM",
    12490: "REF_TRIG_OUTPUT_TERM",
    12491: "START_TRIG_OUTPUT_TERM",
}
"""Properties with the terminals to which a task exports a signal, by the signal."""


def terminal(name: str, module: Module, code: int = -89120, what: str = "Source") -> str:
    """Return the complete name of a terminal, ``/Dev1/PFI0``, of the device or its chassis.

    Args:
        name: With or without the device.
        module: The device with the terminal, or in the chassis with it.
        code: The driver's error where there is no such terminal.
        what: What it is of a route, for the error: its source or its destination.
    """
    owner = module.owner
    route = re.fullmatch(r"(?:/(\w+)/)?(A?PFI)(\d+)", name, re.IGNORECASE)
    if route:
        known = (route[1] or owner).lower() == owner.lower()
        local = f"{route[2]}{int(route[3])}".upper()
        if known and local in terminals(module.device):
            return f"/{owner}/{local}"
    raise DaqmxError(
        code,
        f"{what} terminal to be routed could not be found on the device.\n"
        f"Device: {owner}\n{what} Terminal: {name}",
    )


def terminals(device: DeviceType) -> list[str]:
    """Return the trigger terminals without the device."""
    return [*(f"PFI{n}" for n in range(device.triggers)), *device.analog_triggers]


FINITE, CONTINUOUS = 10178, 10123
FIRST, CURRENT, REFERENCE, FIRST_BEFORE, MOST_RECENT = REFERENCES = tuple(range(10424, 10429))
"""What a read is relative to."""
_RETRIGGERABLE = number("TRIGGER", "START_TRIG_RETRIGGERABLE")
LEAST = 2  # Smallest number of samples, of an acquisition and before or after a reference trigger
_BUFFERS = ((100.0, 1_000), (10e3, 10_000), (1e6, 100_000))
"""Hz and samples: the default buffer of a continuous task up to a rate."""
UNFOLLOWED: dict[str, dict[str, object]] = {
    "TRIGGER": {
        "REF_TRIG_RETRIGGERABLE": False,
        "START_TRIG_DELAY": 0.0,
        "REF_TRIG_DELAY": 0.0,
        "PAUSE_TRIG_TYPE": NONE,
        "ARM_START_TRIG_TYPE": NONE,
    },
    "TIMING": {"DELAY_FROM_SAMP_CLK_DELAY": 0.0},
    "READ": {"OVERWRITE": 10159, "LOGGING_SAMPS_PER_FILE": 0},  # do not overwrite
}
"""Only supported value of properties that the stand-in would not follow, by prefix and name."""


@dataclass
class TaskSettings:
    """A task's channels, timing and triggers."""

    card: Card
    name: str
    channels: dict[str, Input] = field(default_factory=dict)
    """Channels by name, in the order in which they were added."""
    requested_rate: float | None = None
    """Hz; None without a sample clock."""
    clock: str = ""
    """Source of the sample clock; empty for the device's own."""
    clock_edge: int = RISING
    mode: int = CONTINUOUS
    n_samples: int = 1000
    """Samples of each channel of a finite acquisition; requested buffer of a continuous one."""
    buffer: int | None = None
    """Samples of each channel, as set; None for the driver's default."""
    start_trigger: Trigger = field(default_factory=Trigger)
    reference: Trigger = field(default_factory=Trigger)
    before: int = LEAST
    """Samples before the edge of a reference trigger."""
    requested_relative: int | None = None
    """Reference of a read as set; None for the driver's default."""
    reserved: bool = False
    """Whether it holds the card without running."""
    offset: int = 0
    """Samples by which a read starts after its reference."""
    events: dict[str, object] = field(default_factory=dict)
    """Registered events, by kind: a token that ends when it is unregistered."""
    stored: dict[int, Any] = field(default_factory=dict)
    """Properties that are kept as they were set."""
    run: Run | None = None
    """None while it does not run."""

    @property
    def modules(self) -> tuple[Module, ...]:
        """The devices of its channels, in their order; the card's first one without channels."""
        found = dict.fromkeys(channel.module for channel in self.channels.values())
        return tuple(found) or self.card.modules[:1]

    @property
    def device(self) -> DeviceType:
        """Type of the device whose clock samples all channels, and whose triggers start them.

        Other modules follow the first delta-sigma one (NI-DAQmx, "C Series Multidevice Tasks").
        """
        types = [module.device for module in self.modules]
        return next((one for one in types if one.has_own_clock), types[0])

    def most_rate(self) -> float:
        """Return the highest rate [Hz] of every channel."""
        counts = Counter(channel.module for channel in self.channels.values())
        return min(one.device.most(counts[one]) for one in self.modules)

    def add(self, physical: str, name: str, **settings: Any) -> list[Input]:
        """Add channels, `Input` by its ``settings``; the device's limits are verified later."""
        self.must_be_idle()
        terminals = physical_channels(physical, self.card)
        names = [f"{name}{n}" for n in range(len(terminals))] if len(terminals) > 1 else [name]
        if len(terminals) > 1 and ("," in name or ":" in name):
            names = list(split_names(name))
        added = []
        for given, (module, terminal_name) in zip(names, terminals, strict=True):
            channel = Input(module, terminal_name, **settings)
            virtual = given if name else channel.physical
            taken = (other.physical for other in self.channels.values())
            if virtual in self.channels or channel.physical in taken:
                raise DaqmxError(-200489, f"Channel {virtual} is already in the task.")
            added.append(channel)
            self.channels[virtual] = channel
        return added

    def named(self, text: str) -> list[str]:
        """Return the channels that a list with ranges names; all for an empty one."""
        names = [name for name in split_names(text) if name] if text else list(self.channels)
        for name in names:
            if name not in self.channels:
                raise DaqmxError(-200428, f"Channel {name} is not in the task.")
        return names

    def set_clock(self, source: str, rate: float, edge: int, mode: int, n_samples: int) -> None:
        """Configure a sample clock; ``rate`` in Hz. The rest is verified later."""
        self.must_be_idle()
        if mode not in (FINITE, CONTINUOUS):
            raise invalid("SampQuant.SampMode", mode, "finite or continuous")
        self.requested_rate, self.mode, self.n_samples = rate, mode, n_samples
        self.clock = "" if source.lower() == "onboardclock" else source
        self.clock_edge = edge or RISING

    def set_trigger(
        self, trigger: Trigger, kind: int, source: str, edge: int, before: int | None = None
    ) -> None:
        """Configure the start or the reference trigger; its route is verified later."""
        self.must_be_idle()
        if before is not None:
            if before < LEAST:
                raise invalid("RefTrig.PretrigSamples", before, f"{LEAST} or more")
            self.before = before
        trigger.kind, trigger.source, trigger.edge = kind, source, edge

    def remove_trigger(self, trigger: Trigger) -> None:
        """Remove a trigger, if it is configured."""
        self.must_be_idle()
        trigger.kind, trigger.source = NONE, ""

    @property
    def keeps_before(self) -> bool:
        """Whether it has a reference trigger."""
        return self.reference.kind != NONE

    @property
    def relative(self) -> int:
        """Reference of a read."""
        return self.requested_relative or (FIRST_BEFORE if self.keeps_before else CURRENT)

    def set_buffer(self, n: int) -> None:
        """Set the buffer to ``n`` samples of each channel."""
        self.must_be_idle()
        if self.requested_rate is not None and self.mode == FINITE and n < self.n_samples:
            raise invalid("Buf.Input.BufSize", n, f"{self.n_samples} or more")
        self.buffer = n

    @property
    def rate(self) -> float | None:
        """Hz, of the device's clock; None without one."""
        if self.requested_rate is None:
            return None
        if self.clock:
            self.clock_terminal()
            return self.requested_rate
        most = self.most_rate()
        # 1e-9: a rate that was divided among channels may exceed the sum by rounding only.
        if not 0 < self.requested_rate * (1 - 1e-9) <= most:
            limits = f"{self.device.slowest:.6g} to {most:.6g} Hz"
            raise invalid("SampClk.Rate", self.requested_rate, limits)
        return self.device.coerced(min(self.requested_rate, most))

    def clock_terminal(self) -> str:
        """Return the complete name of the sample clock's source."""
        if not self.clock:
            return f"/{self.modules[0].name}/ai/SampleClockTimebase"
        return terminal(self.clock, self.modules[0])

    def checked_samples(self) -> int:
        """Return ``n_samples``, if a task can have so many."""
        if self.n_samples < LEAST:
            raise invalid("SampQuant.SampPerChan", self.n_samples, f"{LEAST} or more")
        return self.n_samples

    @property
    def length(self) -> int:
        """Samples of each channel; `ENDLESS` for an acquisition that does not end by itself."""
        return self.n_samples if self.mode == FINITE and not self.retriggerable else ENDLESS

    @property
    def retriggerable(self) -> bool:
        """Whether every edge of the start trigger starts a finite acquisition."""
        return bool(self.stored.get(_RETRIGGERABLE))

    @property
    def buffer_size(self) -> int:
        """Samples of each channel that are kept until they are read."""
        if self.buffer is not None or self.mode == FINITE:
            return self.n_samples if self.buffer is None else self.buffer
        rate = self.requested_rate or 0
        least = next((n for highest, n in _BUFFERS if rate <= highest), _BUFFERS[-1][1])
        return max(least, self.n_samples)

    def verify(self) -> None:
        """Refuse a task that cannot start."""
        if not self.channels:
            raise DaqmxError(-200460, "There are no input channels in this task.")
        self._verify_clock()
        for channel in self.channels.values():
            channel.verify()
        self.checked_samples()
        triggers = (self.start_trigger, self.reference)
        if self.rate is None and any(trigger.kind != NONE for trigger in triggers):
            raise DaqmxError(-200262, "A trigger needs a sample clock.")
        if self.clock:
            raise DaqmxError(-200452, "The stand-in has no external clock: use the onboard clock.")
        for trigger in triggers:
            trigger.verify(self.modules[0])
        self._verify_stored()
        for name in EXPORTS.values():
            if to := self.stored.get(number("EXPORTSIGNAL", name)):
                terminal(to, self.modules[0], -89121, "Destination")
        self._verify_reference()
        if self.retriggerable and not self.device.retriggers:
            raise DaqmxError(-200452, "This device has no retriggerable start trigger.")
        started = self.start_trigger.kind != NONE and not self.keeps_before
        if self.retriggerable and not (started and self.mode == FINITE):
            raise DaqmxError(
                -201320,
                "Retriggering needs a start trigger, no reference trigger, and a finite number of"
                " samples.",
            )

    def _verify_clock(self) -> None:
        """Refuse devices that are not sampled by one clock."""
        clocks = sorted({module.clock for module in self.modules} - {""})
        if len(clocks) > 1:
            raise DaqmxError(
                -200558,
                "Channels of one task are on several devices, each with a clock of its own.\n"
                f"Devices: {', '.join(clocks)}",
            )

    def _verify_stored(self) -> None:
        """Refuse stored properties that request what would not be done."""
        for prefix, names in UNFOLLOWED.items():
            for name, default in names.items():
                if (value := self.stored.get(number(prefix, name), default)) != default:
                    raise DaqmxError(
                        -200452,
                        f"The stand-in does not follow property {name}, which is set to {value};"
                        " reset it.",
                    )

    def _verify_reference(self) -> None:
        if not self.keeps_before:
            return
        if not self.device.reference_trigger:
            raise DaqmxError(-200452, "This device has no reference trigger.")
        if self.mode != FINITE:
            raise DaqmxError(-200358, "A reference trigger needs a finite acquisition.")
        if self.n_samples - self.before < LEAST:
            raise DaqmxError(
                -200213,
                f"{self.before} pretrigger samples of {self.n_samples} leave less than {LEAST}"
                " after the trigger.",
            )

    def setup(self, rate: float, n_samples: int) -> TaskSetup:
        """Return what the card is asked to do, at a rate [Hz]."""
        edges = [
            trigger.route(self.modules[0]) if trigger.kind == DIGITAL_EDGE else None
            for trigger in (self.start_trigger, self.reference)
        ]
        both = self.keeps_before
        slopes = [each.edge == FALLING for each in (self.start_trigger, self.reference)]
        return TaskSetup(
            tuple(channel.physical for channel in self.channels.values()),
            rate,
            n_samples,
            edges[1] if both else edges[0],
            before=self.before if both else None,
            start_trigger=edges[0] if both else None,
            falling=(slopes[both], slopes[0]),
            lags=tuple(self.lag(n, rate) for n in range(len(self.channels))),
            converters=None
            if any(module.device is IDEAL for module in self.modules)
            else tuple(
                Converter(channel.range, channel.bits) for channel in self.channels.values()
            ),
            limits=tuple(channel.limits for channel in self.channels.values()),
            per_trigger=self.n_samples if self.retriggerable else None,
            buffer=self.buffer_size if n_samples == ENDLESS and not self.retriggerable else ENDLESS,
        )

    def lag(self, position: int, rate: float) -> float:
        """Return by how many s the samples of one channel lag its terminal, at a rate [Hz]."""
        channels = list(self.channels.values())
        channel = channels[position]
        # Each module has its own convert clock, of its own channels (NI-DAQmx, "Device-Specific
        # Sampling Methods").
        own = [n for n, other in enumerate(channels) if other.module == channel.module]
        lag = channel.device.lag(rate, own.index(position), len(own))
        return lag - channel.removed_delay(rate)

    def must_be_idle(self) -> None:
        """Refuse a change while it runs."""
        if self.run is not None:
            raise DaqmxError(
                -200479, f"Specified operation cannot be performed while {self.name} is running."
            )
