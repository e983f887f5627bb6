"""The properties of system, device, physical channel, channel and task."""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.sim_backend.device_types import AC, C_SERIES, DC, IDEAL, USB_DAQ, DeviceType
from sautereau.sim_backend.devices.daqmx.attributes import (
    Attribute,
    field,
    kept,
    number,
    stored,
    table,
)
from sautereau.sim_backend.devices.daqmx.card import (
    INTERNAL,
    LINEAR,
    NO_EXCITATION,
    Card,
    DaqmxError,
    Input,
    Module,
)
from sautereau.sim_backend.devices.daqmx.progress import CardTask
from sautereau.sim_backend.devices.daqmx.task import CONTINUOUS, EXPORTS, FINITE, terminals

SERIAL_NUMBER = 0x5A07E2EA
_CHASSIS = "cDAQ-9178"
_BUS_PCI, _BUS_USB, _BUS_COMPACT_DAQ, _BUS_UNKNOWN = 12582, 12586, 14637, 12588
_START, _REFERENCE = 8, 4  # bits of the driver's trigger usage
_COUPLING_BITS = {AC: 1, DC: 2}
_CONFIGURATION_BITS = {10083: 1, 10078: 2, 10106: 4, 12529: 8}
_VOLTAGE, _VOLTAGE_WITH_EXCITATION = 10322, 10323
_IEPE = (10356, 15966, 15895, 10354)


@dataclass(frozen=True)
class Device:
    """One device of a card, or the chassis that holds them."""

    card: Card
    module: Module
    """For a chassis its first one."""
    is_chassis: bool = False

    @property
    def type(self) -> DeviceType:
        """Its type; for the chassis that of its first module."""
        return self.module.device


def _chassis(one: Device) -> str:
    if not one.module.chassis:
        raise DaqmxError(-200197, "The device is in no chassis.")
    return one.module.chassis


def _slot(one: Device) -> int:
    """Return the number at the end of the name of a module, or its place."""
    numbered = re.search(r"Mod(\d+)$", one.module.name)
    return int(numbered[1]) if numbered else 1 + one.card.modules.index(one.module)


def _inputs(one: Device) -> str:
    return ", ".join(f"{one.module.name}/{name}" for name in one.module.terminals)


def _triggers(one: Device) -> str:
    return ", ".join(f"/{one.module.owner}/{name}" for name in terminals(one.type))


def _measurements(one: Device) -> list[int]:
    return [_VOLTAGE, *(_IEPE if one.type.excitations else [])]


def _bus(one: Device) -> int:
    buses = {C_SERIES: _BUS_COMPACT_DAQ, USB_DAQ: _BUS_USB}
    return buses.get(one.type.category, _BUS_UNKNOWN if one.type is IDEAL else _BUS_PCI)


SYSTEM = table(
    "SYSTEM",
    {
        "NIDAQ_MAJOR_VERSION": 25,
        "NIDAQ_MINOR_VERSION": 0,
        "NIDAQ_UPDATE_VERSION": 0,
        "DEV_NAMES": lambda card: ", ".join(
            dict.fromkeys(name for one in card.modules for name in (one.owner, one.name))
        ),
        "GLOBAL_CHANS": "",
        "SCALES": "",
        "TASKS": "",
    },
)
_ABSENT = (
    "AO_PHYSICAL_CHANS",
    "DI_LINES",
    "DI_PORTS",
    "DO_LINES",
    "DO_PORTS",
    "CI_PHYSICAL_CHANS",
    "CO_PHYSICAL_CHANS",
    "CHASSIS_MODULE_DEV_NAMES",
    "ACCESSORY_PRODUCT_TYPES",
)
_OF_CARD = table(
    "DEVICE",
    {
        "IS_SIMULATED": True,
        "PRODUCT_TYPE": lambda one: one.type.product,
        "PRODUCT_CATEGORY": lambda one: one.type.category,
        "PRODUCT_NUM": 0,
        "SERIAL_NUM": SERIAL_NUMBER,
        "BUS_TYPE": _bus,
        "COMPACT_DAQ_CHASSIS_DEV_NAME": _chassis,
        "COMPACT_DAQ_SLOT_NUM": lambda one: _slot(one) if _chassis(one) else 0,
        "TERMINALS": _triggers,
        "DIG_TRIG_SUPPORTED": True,
        "ANLG_TRIG_SUPPORTED": lambda one: bool(one.type.analog_triggers),
        "TIME_TRIG_SUPPORTED": False,
        "TEDS_HWTEDS_SUPPORTED": False,
        "NUM_TIME_TRIGS": 0,
        "NUM_DMA_CHANS": 0,
        "AI_TRIG_USAGE": lambda one: _START | (_REFERENCE if one.type.reference_trigger else 0),
        "AI_PHYSICAL_CHANS": _inputs,
        "AI_SUPPORTED_MEAS_TYPES": _measurements,
        "AI_SAMP_MODES": [FINITE, CONTINUOUS],
        "AI_SIMULTANEOUS_SAMPLING_SUPPORTED": lambda one: one.type.simultaneous,
        "AI_MAX_SINGLE_CHAN_RATE": lambda one: one.type.fastest,
        "AI_MAX_MULTI_CHAN_RATE": lambda one: one.type.fastest_many,
        "AI_MIN_RATE": lambda one: one.type.slowest,
        "AI_NUM_SAMP_TIMING_ENGINES": 1,
        "AI_VOLTAGE_RNGS": lambda one: [
            volts for high in one.type.ranges for volts in (-high, high)
        ],
        "AI_CURRENT_INT_EXCIT_DISCRETE_VALS": lambda one: list(one.type.excitations),
        "AI_VOLTAGE_INT_EXCIT_DISCRETE_VALS": [],
        "AI_COUPLINGS": lambda one: sum(_COUPLING_BITS[bit] for bit in one.type.couplings),
        **dict.fromkeys(_ABSENT, ""),
    },
)
_OF_CHASSIS = table(
    "DEVICE",
    {
        "IS_SIMULATED": True,
        "PRODUCT_TYPE": _CHASSIS,
        "PRODUCT_CATEGORY": 14658,
        "SERIAL_NUM": SERIAL_NUMBER + 1,
        "BUS_TYPE": _BUS_USB,
        "CHASSIS_MODULE_DEV_NAMES": lambda one: ", ".join(
            other.name for other in one.card.modules if other.chassis == one.module.chassis
        ),
        "TERMINALS": _triggers,
        "DIG_TRIG_SUPPORTED": True,
        "AI_PHYSICAL_CHANS": "",
        **dict.fromkeys((name for name in _ABSENT if not name.startswith("CHASSIS")), ""),
    },
)


def _of_either(key: int) -> Attribute:
    def read(about: Device) -> Any:
        owned = _OF_CHASSIS if about.is_chassis else _OF_CARD
        if key not in owned:
            raise DaqmxError(-200197, f"Property {key:#x} is not supported by the device.")
        return owned[key].read(about)

    return Attribute(read)


DEVICE = {key: _of_either(key) for key in (*_OF_CARD, *_OF_CHASSIS)}
"""Properties of a device, or of the chassis."""

_TEDS = (
    "MFG_ID", "MODEL_NUM", "SERIAL_NUM", "VERSION_NUM", "VERSION_LETTER", "BIT_STREAM",
    "TEMPLATE_I_DS",
)  # fmt: skip


def _no_memory(one: Device) -> Any:
    raise DaqmxError(-200741, "The stand-in has no TEDS sensors: the rig file has calibrations.")


PHYSICAL_CHANNEL = table(
    "PHYSICALCHANNEL",
    {
        "PHYSICAL_CHAN_AI_SUPPORTED_MEAS_TYPES": _measurements,
        "PHYSICAL_CHAN_AI_TERM_CFGS": lambda one: sum(
            _CONFIGURATION_BITS[bit] for bit in one.type.configurations
        ),
        "PHYSICAL_CHAN_AI_INPUT_SRCS": "_external_channel",
        **dict.fromkeys((f"PHYSICAL_CHAN_TEDS_{name}" for name in _TEDS), _no_memory),
    },
)

MOST_INFO = 4  # Characters of a card's own note, as of an NI PCIe-6363


@dataclass
class Calibration:
    """Dates and note of the calibration of a device; a simulated converter does not drift."""

    external: datetime
    """Date of the external one: that of the server's start."""
    own: datetime
    """Date of the self-calibration."""
    stored: dict[int, Any] = dataclass_field(default_factory=dict)


def _note(about: Calibration, text: str) -> None:
    if len(text) > MOST_INFO:
        raise DaqmxError(-201245, f"The device keeps a note of up to {MOST_INFO} characters.")
    about.stored[_NOTE] = text


_NOTE = number("CALIBRATIONINFO", "CAL_USER_DEFINED_INFO")
CALIBRATION = table(
    "CALIBRATIONINFO",
    {
        "SELF_CAL_SUPPORTED": True,
        # degC: NI's simulated devices answer 0 as well
        **dict.fromkeys(("CAL_DEV_TEMP", "EXT_CAL_LAST_TEMP", "SELF_CAL_LAST_TEMP"), 0.0),
        "EXT_CAL_RECOMMENDED_INTERVAL": 24,  # months
        "CAL_USER_DEFINED_INFO": Attribute(lambda about: about.stored.get(_NOTE, ""), _note),
        "CAL_USER_DEFINED_INFO_MAX_SIZE": MOST_INFO,
    },
)
"""The calibration of a device."""

EXPORTED = kept(
    "EXPORTSIGNAL",
    {
        **dict.fromkeys(EXPORTS.values(), ""),
        "SAMP_CLK_OUTPUT_BEHAVIOR": 10265,  # a pulse
        **{f"{name}_PULSE_POLARITY": 10095 for name in ("SAMP_CLK", "START_TRIG", "REF_TRIG")},
    },
)
"""Signals that a task puts on terminals, to which the bench connects nothing."""

_SECONDS, _PERIODS, _EXTERNAL = 10364, 10286, 10167
_RIGHT, _DMA, _NO_COMPRESSION, _USE_CURRENT, _USE_DC = 10279, 10054, 10230, 10134, 10050


@dataclass(frozen=True)
class Seat:
    """A channel in its task."""

    task: CardTask
    name: str

    @property
    def input(self) -> Input:
        """The channel itself."""
        return self.task.channels[self.name]

    def must_be_idle(self) -> None:
        """Refuse a change while its task runs."""
        self.task.must_be_idle()

    @property
    def stored(self) -> dict[int, object]:
        """Properties that are kept as they were set."""
        return self.input.stored


def _has_filter(seat: Seat) -> None:
    if not any(seat.input.device.filter_delay):
        raise DaqmxError(-200452, "The device has no digital filter with a delay.")


def _has_excitation(seat: Seat) -> None:
    if not seat.input.device.excitations and _EXCITATION not in seat.stored:
        raise DaqmxError(-200452, "The device supplies no excitation.")


def _filter_delay(seat: Seat) -> float:
    _has_filter(seat)
    rate = seat.task.rate or 1000.0
    samples, seconds = seat.input.device.filter_delay
    delay = samples / rate + seconds
    return delay * rate if seat.stored.get(_UNITS) == _PERIODS else delay


def _configuration(seat: Seat) -> int:
    seat.input.verify()
    given = seat.input.configuration
    return seat.input.device.configurations[0] if given == -1 else given


def _of_input(name: str, default: object, read: Callable[[Seat], object]) -> Attribute:
    return field(name, default, read, of=lambda seat: seat.input)


def _ends(seat: Seat) -> NDArray[np.float64]:
    return np.array([-1.0, 1.0]) * seat.input.range


def _limit(name: str, sign: int) -> Attribute:
    return _of_input(
        name,
        math.nan,  # must be set before it is read
        lambda seat: sign * max(sign * float(end) for end in seat.input.scaled(_ends(seat))),
    )


def _unscale(seat: Seat) -> None:
    seat.must_be_idle()
    seat.input.custom_scale, seat.input.forward, seat.input.reverse = "", *LINEAR


def _scaling(seat: Seat) -> list[float]:
    if seat.input.device is IDEAL:
        raise DaqmxError(-200452, "An ideal device has no converter.")
    return [0.0, seat.input.step, 0.0, 0.0]


def _coupling(seat: Seat) -> int:
    couplings = seat.input.device.couplings
    return AC if AC in couplings and seat.input.measurement in _IEPE else DC


def _sources(seat: Seat) -> tuple[int, ...]:
    internal = (INTERNAL,) if seat.input.device.excitations else ()
    return *internal, _EXTERNAL, NO_EXCITATION


_UNITS = number("CHANNEL", "AI_FILTER_DELAY_UNITS")
_EXCITATION = number("CHANNEL", "AI_EXCIT_VAL")
_CHOICES: dict[str, tuple[Any, ...]] = {
    "AI_COUPLING": (_coupling, lambda seat: seat.input.device.couplings),
    "AI_EXCIT_SRC": (NO_EXCITATION, _sources),
    "AI_EXCIT_VAL": (0.0, lambda seat: (0.0, *seat.input.device.excitations), _has_excitation),
    "AI_FILTER_DELAY_UNITS": (_SECONDS, lambda seat: (_SECONDS, _PERIODS), _has_filter),
    "AI_REMOVE_FILTER_DELAY": (False, lambda seat: (False, True), _has_filter),
}
"""Arguments of `stored` for properties with a few possible values."""

CHANNEL = {
    **kept(
        "CHANNEL",
        {
            "CHAN_DESCR": "",
            "CHAN_IS_GLOBAL": False,
            "AI_VOLTAGE_UNITS": 10348,
            "AI_FORCE_UNITS": 15875,
            "AI_FORCE_IEPE_SENSOR_SENSITIVITY": 2.25,
            "AI_FORCE_IEPE_SENSOR_SENSITIVITY_UNITS": 15891,
            "AI_ACCEL_UNITS": 10186,
            "AI_ACCEL_SENSITIVITY": 1000.0,
            "AI_ACCEL_SENSITIVITY_UNITS": 12509,
            "AI_VELOCITY_UNITS": 15959,
            "AI_VELOCITY_IEPE_SENSOR_SENSITIVITY": 100.0,
            "AI_VELOCITY_IEPE_SENSOR_SENSITIVITY_UNITS": 15963,
            "AI_CURRENT_UNITS": 10342,
            "AI_CURRENT_SHUNT_LOC": 10167,
            "AI_CURRENT_SHUNT_RESISTANCE": 249.0,
            "AI_SOUND_PRESSURE_UNITS": 10081,
            "AI_MICROPHONE_SENSITIVITY": 10.0,
            "AI_SOUND_PRESSURE_MAX_SOUND_PRESSURE_LVL": 100.0,
            "AI_EXCIT_VOLTAGE_OR_CURRENT": _USE_CURRENT,
            "AI_EXCIT_D_COR_AC": _USE_DC,
            "AI_EXCIT_USE_FOR_SCALING": False,
            "AI_EXCIT_USE_MULTIPLEXED": False,
            "AI_BRIDGE_CFG": 10228,
            "AI_DITHER_ENABLE": True,
            "AI_MEM_MAP_ENABLE": False,
            "AI_DATA_XFER_MECH": _DMA,
            "AI_RAW_DATA_COMPRESSION_TYPE": _NO_COMPRESSION,
            "AI_LOSSY_LSB_REMOVAL_COMPRESSED_SAMP_SIZE": lambda seat: seat.input.device.raw_bits,
            "AI_ENHANCED_ALIAS_REJECTION_ENABLE": False,
            "AI_ATTEN": 0.0,
            "AI_GAIN": 1.0,
        },
    ),
    **table(
        "CHANNEL",
        {
            "CHAN_TYPE": 10100,  # An analog input
            "PHYSICAL_CHAN_NAME": lambda seat: seat.input.physical,
            "AI_MEAS_TYPE": lambda seat: seat.input.measurement,
            "AI_IS_TEDS": False,
            "AI_CUSTOM_SCALE_NAME": Attribute(lambda seat: seat.input.custom_scale, clear=_unscale),
            "AI_MAX": _limit("high", 1),
            "AI_MIN": _limit("low", -1),
            "AI_RNG_HIGH": _of_input("requested_range", None, lambda seat: seat.input.range),
            "AI_RNG_LOW": _of_input("requested_range", None, lambda seat: -seat.input.range),
            "AI_TERM_CFG": _of_input("configuration", -1, _configuration),
            **{name: stored("CHANNEL", name, *given) for name, given in _CHOICES.items()},
            "AI_EXCIT_ACTUAL_VAL": Attribute(lambda seat: seat.stored.get(_EXCITATION, 0.0)),
            "AI_FILTER_DELAY": _filter_delay,
            "AI_RESOLUTION": lambda seat: float(seat.input.bits),
            "AI_RESOLUTION_UNITS": 10109,
            "AI_RAW_SAMP_SIZE": lambda seat: seat.input.device.raw_bits,
            "AI_RAW_SAMP_JUSTIFICATION": _RIGHT,
            "AI_DEV_SCALING_COEFF": _scaling,
        },
    ),
}


TASK = table(
    "TASK",
    {
        "NAME": lambda task: task.name,
        "CHANNELS": lambda task: ", ".join(task.channels),
        "DEVICES": lambda task: ", ".join(one.name for one in task.modules) * bool(task.channels),
        "NUM_CHANS": lambda task: len(task.channels),
        "NUM_DEVICES": lambda task: len(task.modules) if task.channels else 0,
        "COMPLETE": lambda task: task.done,
    },
)
