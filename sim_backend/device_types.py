"""The analog inputs of the devices that the stand-in may be: what their specifications say."""

import math
from dataclasses import dataclass, replace

C_SERIES, M_SERIES, X_SERIES, USB_DAQ, UNKNOWN = 14659, 14643, 15858, 14646, 12588
"""Product categories."""
RSE, NRSE, DIFF, PSEUDO_DIFF = 10083, 10078, 10106, 12529  # Terminal configurations
AC, DC = 10045, 10050  # Couplings


@dataclass(frozen=True)
class DeviceType:
    """The analog inputs of one product."""

    product: str
    category: int = UNKNOWN
    inputs: int | None = None
    """Number of inputs, from ai0 on; None for those that the rig uses."""
    ranges: tuple[float, ...] = (10.0,)
    """V, largest magnitude of each range, ascending."""
    bits: int = 24
    raw_bits: int = 32
    """Bits of a count as it is read."""
    fastest: float = 1e6
    """Hz, of a single input."""
    fastest_many: float = 1e6
    """Hz, of several inputs: of each where they are sampled simultaneously, else of all."""
    timebase: float | None = None
    """Hz, of which every rate is an integer fraction; None where every rate is possible."""
    most_divisions: int = 2**32 - 1
    simultaneous: bool = True
    settling: float = 0.0
    """s, that the driver adds to the time of a multiplexer's conversion if the rate permits."""
    filter_delay: tuple[float, float] = (0.0, 0.0)
    """Delay of the digital filter: samples, and s in addition."""
    couplings: tuple[int, ...] = (DC,)
    configurations: tuple[int, ...] = (DIFF, RSE, NRSE, PSEUDO_DIFF)
    """The first one is the default."""
    single_ended: tuple[float, int] | None = None
    """The only range [V] and the bits of single-ended inputs, where those of others differ."""
    excitations: tuple[float, ...] = ()
    """A, currents for IEPE sensors."""
    triggers: int = 16
    """Number of digital trigger terminals, from PFI0 on, of the device or of its chassis."""
    reference_trigger: bool = True
    retriggers: bool = False
    """Whether each edge of the start trigger can start a finite acquisition again."""
    analog_triggers: tuple[str, ...] = ()
    """Terminals of an analog trigger."""

    @property
    def in_chassis(self) -> bool:
        """Whether it is a module, whose trigger terminals are those of its chassis."""
        return self.category == C_SERIES

    @property
    def has_own_clock(self) -> bool:
        """Whether it oversamples with a clock of its own, which others in its task then follow."""
        return self.filter_delay[0] > 0

    @property
    def slowest(self) -> float:
        """Hz."""
        return 0.0 if self.timebase is None else self.timebase / self.most_divisions

    def most(self, n_inputs: int) -> float:
        """Return the highest rate [Hz] of each of so many inputs."""
        if n_inputs <= 1:
            return self.fastest
        return self.fastest_many if self.simultaneous else self.fastest_many / n_inputs

    def coerced(self, rate: float) -> float:
        """Return the rate [Hz] at which the device samples instead: the next one above."""
        if self.timebase is None:
            return rate
        # Rounded first: the last digits of a quotient are no reason for another divisor.
        divisions = math.floor(round(self.timebase / rate, 9))
        return self.timebase / max(1, min(divisions, self.most_divisions))

    def range_for(self, volts: float, configuration: int) -> float | None:
        """Return the smallest range [V] that takes so much; None if there is none."""
        single = self.single_ended if configuration == RSE else None
        ranges = (single[0],) if single else self.ranges
        return next((high for high in ranges if high >= volts), None)

    def bits_of(self, configuration: int) -> int:
        """Return the bits of an input of a terminal configuration."""
        return self.single_ended[1] if self.single_ended and configuration == RSE else self.bits

    def conversion_rate(self, rate: float, n_inputs: int) -> float:
        """Return the rate [Hz] at which a multiplexer converts inputs one after the other.

        As fast as it can with `settling` added, or evenly spaced if that takes too long (M Series
        User Manual, NI 371022, "AI Convert Clock").
        """
        slow = 1 / (1 / self.fastest_many + self.settling)
        return max(slow, min(rate * n_inputs, self.fastest_many))

    def lag(self, rate: float, position: int, n_inputs: int) -> float:
        """Return by how many s the samples of an input lag its terminals.

        Args:
            rate: Hz.
            position: Of the input in the task, from 0.
        """
        samples, seconds = self.filter_delay
        delay = samples / rate + seconds
        if self.simultaneous or not position:
            return delay
        return delay - position / self.conversion_rate(rate, n_inputs)


IDEAL = DeviceType("sautereau stand-in", retriggers=True)  # Without delay, with every rate

_DELTA_SIGMA = DeviceType("", C_SERIES, inputs=4, most_divisions=31, triggers=2)
_SAR_MODULE = DeviceType("", C_SERIES, bits=16, raw_bits=16, timebase=80e6, triggers=2)
_M_AND_X_SERIES = DeviceType(
    "",
    ranges=(0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0),
    bits=16,
    raw_bits=16,
    simultaneous=False,
    settling=10e-6,
    configurations=(DIFF, RSE, NRSE),
    analog_triggers=("APFI0", "APFI1"),
)

DEVICE_TYPES = {
    device.product: device
    for device in (
        IDEAL,
        # NI 9215 Datasheet, 373779: 16 bits, +-10 V, 100 kS/s, simultaneous, without a filter. Its
        # sample clock is the chassis', an integer fraction of 80 MHz.
        replace(
            _SAR_MODULE,
            product="NI 9215",
            inputs=4,
            fastest=100_000.0,
            fastest_many=100_000.0,
            configurations=(DIFF,),
        ),
        # NI 9205 Datasheet, 378020: 16 bits, 250 kS/s for all inputs together.
        replace(
            _SAR_MODULE,
            product="NI 9205",
            inputs=32,
            ranges=(0.2, 1.0, 5.0, 10.0),
            fastest=250_000.0,
            fastest_many=250_000.0,
            simultaneous=False,
            settling=10e-6,
            configurations=(DIFF, RSE, NRSE),
        ),
        # NI 9234 Datasheet, 374238: 13.1072 MHz / 256 / n, input delay 38.4 / fs + 3.2 us.
        replace(
            _DELTA_SIGMA,
            product="NI 9234",
            ranges=(5.0,),
            fastest=51_200.0,
            fastest_many=51_200.0,
            timebase=51_200.0,
            filter_delay=(38.4, 3.2e-6),
            couplings=(DC, AC),
            configurations=(PSEUDO_DIFF,),
            excitations=(0.002,),
        ),
        # NI 9239 Datasheet: 12.8 MHz / 256 / n, input delay (40 + 5/512) / fs + 3.3 us.
        replace(
            _DELTA_SIGMA,
            product="NI 9239",
            fastest=50_000.0,
            fastest_many=50_000.0,
            timebase=50_000.0,
            filter_delay=(40 + 5 / 512, 3.3e-6),
            configurations=(DIFF,),
        ),
        # USB-6008/6009 User Guide and Specifications, 371303: 14 bits differential, 13 bits single,
        # 48 kS/s for all inputs together, 24 MHz. That conversions are spaced as in M Series is
        # assumed.
        DeviceType(
            "USB-6009",
            category=USB_DAQ,
            inputs=8,
            ranges=(1.0, 1.25, 2.0, 2.5, 4.0, 5.0, 10.0, 20.0),
            bits=14,
            raw_bits=16,
            fastest=48_000.0,
            fastest_many=48_000.0,
            timebase=24e6,
            simultaneous=False,
            settling=10e-6,
            configurations=(DIFF, RSE),
            single_ended=(10.0, 13),
            triggers=1,
            reference_trigger=False,
        ),
        # NI 6251 Specifications, 375213: 1.25 MS/s single, 1 MS/s multichannel, 20 MHz.
        replace(
            _M_AND_X_SERIES,
            product="PCI-6251",
            category=M_SERIES,
            inputs=16,
            fastest=1.25e6,
            timebase=20e6,
        ),
        # NI 6363 Specifications: 2 MS/s single, 1 MS/s multichannel, 100 MHz. Of these products
        # only the X Series' AI Start Trigger is retriggerable (X Series User Manual, NI 370784).
        replace(
            _M_AND_X_SERIES,
            product="PCIe-6363",
            category=X_SERIES,
            inputs=32,
            fastest=2e6,
            timebase=100e6,
            retriggers=True,
        ),
    )
}
"""Device types by product.

The inputs of a differential pair are not distinguished from single ones.
"""
