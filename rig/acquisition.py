"""The acquisition in numbers: card, channels and their sensors; part of `sautereau.rig.schema`."""

import math
from dataclasses import dataclass
from datetime import date
from types import SimpleNamespace
from typing import Annotated, Literal

from pydantic import Field, model_validator

from sautereau.rig.disk import table_beside
from sautereau.rig.errors import RigError
from sautereau.rig.registry import SOURCES, NameIn, Registry
from sautereau.rig.units import Current, Frequency, Length, Section, Time, Unit, UnitBy, Voltage


@dataclass(frozen=True)
class MeasuredQuantity:
    """What a sensor measures."""

    name: str
    """Name in the rig file: `velocity`."""
    unit: str
    """SI unit of the signal, as pint spells it: `m/s`."""
    meaning: str
    """What is measured, and where."""
    positive: str
    """Sign convention: what a positive value means."""
    example: str
    """A scale as the rig file writes it: `25 mm/s/V`."""

    @property
    def scale_unit(self) -> str:
        """SI unit of a sensor's scale: `m/s/V`."""
        return f"{self.unit}/V"


OF_PLACE = ("string_displacement", "string_velocity")  # Quantities of a place along a string
OF_STRING = (*OF_PLACE, "bridge_force")  # Quantities of one string
BUILT_IN = SimpleNamespace(**{row[0]: MeasuredQuantity(*row) for row in table_beside(__file__)})
MEASURED = Registry(
    "sautereau.measured_quantities",
    "measured quantity",
    {name: f"sautereau.rig.acquisition:BUILT_IN.{name}" for name in vars(BUILT_IN)},
    RigError,
)
"""Each is a `MeasuredQuantity`. The analysis uses velocity, force and those of strings; the others
are recorded."""


def _scale_unit(quantity: str) -> Unit:
    measured = MEASURED.get(quantity)
    return Unit(measured.scale_unit, measured.example)


class Channel(Section):
    """One analog input: what it measures, and the calibration of its sensor."""

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    """Name of the signal, and of its topic in a recording."""
    terminal: str = Field(min_length=1)
    """Physical channel of the DAQ device, without the name of the device: `ai0`. For a sound card:
    `in1`."""
    device: str = ""
    """Name of the device in NI MAX, such as another module of the same chassis: `cDAQ1Mod2`. Empty
    for `daq.device`."""
    sensor: str
    """Make and model of the sensor."""
    range: Voltage = Field(gt=0)
    """V, maximum magnitude that sensor and input accept."""
    delay: Time = Field(ge=0)
    """s, delay of the signal after the motion."""
    low_pass: Frequency = Field(ge=0)
    """Hz, corner frequency of the sensor's low-pass; 0 for none."""
    low_pass_order: int = Field(default=0, strict=True, ge=0, le=8)
    """Order of the low-pass as a Butterworth filter, whose delay is added to `delay`; 0 if `delay`
    includes it."""
    high_pass: Frequency = Field(ge=0)
    """Hz, corner frequency of the AC coupling; 0 for none."""
    delay_std: Time = Field(default=20e-6, ge=0)
    """s, standard uncertainty of `delay`."""
    gain_std: float = Field(default=0.01, ge=0, le=0.5)
    """Dimensionless, relative standard uncertainty of `scale`."""
    terminal_configuration: Literal["default", "rse", "nrse", "diff", "pseudo_diff"] = "default"
    """Ground reference of the input, which must match the wiring of the sensor. `default` keeps the
    setting of the device."""
    input_coupling: Literal["default", "ac", "dc"] = "default"
    """Coupling of the input, if the device can switch it. With `ac`, enter the corner of the
    device's high-pass into `high_pass`."""
    excitation: Current = Field(default=0.0, ge=0, le=0.1)
    """A, constant current that the input supplies to an IEPE sensor; 0 for none."""
    input_delay: Time = Field(default=0.0, ge=-0.1, le=1)
    """s, delay of the device's samples after its terminals: the delay of its digital filter, minus
    the time by which a multiplexer samples this input later. It is read from the device and written
    into every recording; a value given here is replaced."""
    serial_number: str = ""
    """Serial number, as engraved on the sensor."""
    calibrated: date | None = None
    """Date of the calibration."""
    quantity: Annotated[str, NameIn(MEASURED)]
    """Measured quantity: `velocity`, `displacement` or `acceleration` of the key at the laser spot
    (`key.laser_arm`), positive downwards; `force` of the finger on the key, positive when it
    presses; `string_displacement` and `string_velocity` of a string at `place`, upwards;
    `bridge_force` of a string; `sound_pressure`; `voltage`; or a quantity of another package."""
    scale: Annotated[float, UnitBy("quantity", MEASURED.names, _scale_unit)] = Field(gt=0)
    """Scale of the sensor: measured quantity per volt."""
    string: int = Field(default=1, strict=True, ge=1)
    """Number of the string, of a quantity of a string."""
    place: Length | None = Field(default=None, gt=0)
    """m, from the nut: where `string_displacement` or `string_velocity` is measured."""

    @model_validator(mode="after")
    def _place_on_a_string(self):
        faults = []
        if (self.place is None) == (self.quantity in OF_PLACE):
            how = "give it" if self.place is None else "remove it"
            faults.append(
                f"place: {self.quantity} is {'' if self.place is None else 'not '}measured at a"
                f" place along a string; {how}"
            )
        if self.string > 1 and self.quantity not in OF_STRING:
            faults.append(f"string: {self.quantity} is not that of a string; remove it")
        if faults:
            raise ValueError("\n".join(faults))
        return self

    @model_validator(mode="after")
    def _corners_in_order(self):
        if 0 < self.low_pass <= self.high_pass:
            raise ValueError(
                f"high_pass: {self.high_pass:.6g} Hz is not below low_pass, {self.low_pass:.6g} Hz,"
                " so nothing would pass; lower it or raise low_pass"
            )
        if self.low_pass_order and not self.low_pass:
            raise ValueError(
                f"low_pass_order: {self.low_pass_order} is given and low_pass is 0 Hz, which is no"
                " filter; give low_pass its corner, or low_pass_order = 0"
            )
        return self

    @property
    def unit(self) -> str:
        """SI unit of the signal."""
        return MEASURED.get(self.quantity).unit

    @property
    def lag(self) -> float:
        """s, of the signal behind a slow motion: `delay`, `input_delay`, the low-pass's own."""
        return self.delay + self.input_delay + self.low_pass_delay

    @property
    def low_pass_delay(self) -> float:
        """s, of a slow motion in the low-pass; 0 if `delay` includes it.

        A Butterworth filter of order n delays low frequencies by 1 / (w sin(pi / 2n)).
        """
        if not self.low_pass_order:
            return 0.0
        corner = 2 * math.pi * self.low_pass
        return 1 / (corner * math.sin(math.pi / (2 * self.low_pass_order)))


class Tls(Section):
    """Certificates for an encrypted connection to a gRPC server: paths of PEM files."""

    root_certificate: str = Field(min_length=1)
    """Certificate of the authority that signed the server's certificate."""
    client_certificate: str = ""
    """Certificate of this machine, if the server asks for one."""
    client_key: str = ""
    """Private key of the client certificate."""

    @model_validator(mode="after")
    def _key_with_certificate(self):
        if bool(self.client_certificate) != bool(self.client_key):
            given = "client_certificate" if self.client_certificate else "client_key"
            raise ValueError(
                f"client_certificate, client_key: only {given} is given; give both or neither"
            )
        return self


class Daq(Section):
    """The acquisition device."""

    driver: Annotated[str, NameIn(SOURCES, imported=False)] = "nidaqmx"
    """Driver of the acquisition: `nidaqmx`, `sound-card` (extra `sound`), or one of another
    package."""
    address: str
    """`host:port` of NI's gRPC device server. Empty for the driver of this machine."""
    tls: Tls | None = None
    """Required for an address on another machine, unless `insecure` is set."""
    insecure: bool = Field(default=False, strict=True)
    """Whether to connect to another machine without `tls`, neither encrypted nor authenticated."""
    device: str = Field(min_length=1)
    """Name of the device in NI MAX. For a sound card: a part of its name."""
    sample_rate: Frequency = Field(ge=1000, le=1e6)
    """Hz, sample rate of every channel."""
    trigger_source: str = Field(min_length=1)
    """Terminal to which the controller's trigger output is wired. `PFI0` is that of the device or,
    for a module, of its chassis; any other is named like `/cDAQ1/PFI0`. For a sound card: the input
    to which the output is wired, such as `in3`."""
    trigger_edge: Literal["rising", "falling"] = "rising"
    """Edge at that terminal when the output is set. It depends on the output's circuit."""
    pre_trigger: Time = Field(default=0.0, ge=0, le=60)
    """s, recorded time before the trigger's edge."""
    trigger_timeout: Time = Field(gt=0)
    """s, maximum time to wait for the trigger's edge, and for each block of samples after it."""
    tail: Time = Field(ge=0)
    """s, recorded time after the end of the motion."""
    block: int = Field(strict=True, ge=16, le=100_000)
    """Number of samples per read."""
    channels: tuple[Channel, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _each_channel_once(self):
        for what, values in (
            ("name", [channel.name for channel in self.channels]),
            ("terminal", [self.physical(channel) for channel in self.channels]),
        ):
            twice = sorted({value for value in values if values.count(value) > 1})
            if twice:
                raise ValueError(
                    f"channels: {what} {', '.join(twice)} is used twice; give each channel its own"
                )
        return self

    @model_validator(mode="after")
    def _safe_or_not(self):
        if self.tls and self.insecure:
            raise ValueError(
                "tls, insecure: both are given and contradict each other; remove insecure"
            )
        if (self.tls or self.insecure) and not self.address:
            given = "tls" if self.tls else "insecure"
            raise ValueError(f"{given}: it has no effect without an address; remove it")
        return self

    def physical(self, channel: Channel) -> str:
        """Return the complete name of a channel's terminal: ``cDAQ1Mod2/ai0``."""
        return f"{self.device_of(channel)}/{channel.terminal}"

    def device_of(self, channel: Channel) -> str:
        """Return the device whose terminal a channel has."""
        return channel.device or self.device

    @property
    def devices(self) -> tuple[str, ...]:
        """The devices of the channels, each once, in the order of the channels."""
        return tuple(dict.fromkeys(map(self.device_of, self.channels)))

    def channel(self, quantity: str) -> Channel | None:
        """Return the first channel that measures ``quantity``, or None."""
        return next((c for c in self.channels if c.quantity == quantity), None)
