"""One channel of a task: what it was asked for, and what the device makes of it."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from nidaqmx._stubs import nidaqmx_pb2 as pb
from numpy.typing import NDArray

from sautereau.sim_backend.device_types import DeviceType
from sautereau.sim_backend.devices.daqmx.card import DaqmxError, Module

REMOVE_FILTER_DELAY = pb.CHANNEL_ATTRIBUTE_AI_REMOVE_FILTER_DELAY
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
    volts_per_unit: float = 1.0
    """V per unit of the channel: its sensor's sensitivity, or of its custom scale."""
    zero: float = 0.0
    """Units of 0 V, of a custom scale."""
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
        low, high = ((limit - self.zero) * self.volts_per_unit for limit in (self.low, self.high))
        return min(low, high), max(low, high)

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
        plain = self.volts_per_unit == 1 and not self.zero
        return volts if plain else volts / self.volts_per_unit + self.zero

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
