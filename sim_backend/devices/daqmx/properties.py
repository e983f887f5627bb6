"""The properties of system, device, physical channel and task."""

from dataclasses import dataclass
from typing import Any

from sautereau.sim_backend.device_types import C_SERIES, IDEAL, USB_DAQ
from sautereau.sim_backend.devices.daqmx.attributes import Attribute, table
from sautereau.sim_backend.devices.daqmx.card import Card, DaqmxError, owner_of
from sautereau.sim_backend.devices.daqmx.task import CONTINUOUS, FINITE
from sautereau.sim_backend.devices.daqmx.triggers import terminals

SERIAL_NUMBER = 0x5A07E2EA
VERSION = (25, 0, 0)
_CHASSIS = "cDAQ-9171"
_BUS_PCI, _BUS_USB, _BUS_COMPACT_DAQ, _BUS_UNKNOWN = 12582, 12586, 14637, 12588
_START, _REFERENCE = 8, 4  # bits of the driver's trigger usage
_AC_BIT, _DC_BIT = 1, 2
_CONFIGURATION_BITS = {10083: 1, 10078: 2, 10106: 4, 12529: 8}
_VOLTAGE, _VOLTAGE_WITH_EXCITATION = 10322, 10323
_IEPE = [10356, 15966, 15895, 10354]


def _inputs(card: Card) -> str:
    return ", ".join(f"{card.name}/{terminal}" for terminal in card.terminals)


def _chassis(card: Card) -> str:
    if not card.chassis:
        raise DaqmxError(-200197, "The device is in no chassis.")
    return card.chassis


def _measurements(card: Card) -> list[int]:
    return [_VOLTAGE, *(_IEPE if card.device.excitations else [])]


def _bus(card: Card) -> int:
    buses = {C_SERIES: _BUS_COMPACT_DAQ, USB_DAQ: _BUS_USB}
    return buses.get(card.device.category, _BUS_UNKNOWN if card.device is IDEAL else _BUS_PCI)


def _couplings(card: Card) -> int:
    bits = {10045: _AC_BIT, 10050: _DC_BIT}
    return sum(bits[coupling] for coupling in card.device.couplings)


def _usage(card: Card) -> int:
    return _START | (_REFERENCE if card.device.reference_trigger else 0)


SYSTEM = table(
    "SYSTEM",
    {
        "NIDAQ_MAJOR_VERSION": VERSION[0],
        "NIDAQ_MINOR_VERSION": VERSION[1],
        "NIDAQ_UPDATE_VERSION": VERSION[2],
        "DEV_NAMES": lambda card: ", ".join(dict.fromkeys([owner_of(card), card.name])),
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
        "PRODUCT_TYPE": lambda card: card.device.product,
        "PRODUCT_CATEGORY": lambda card: card.device.category,
        "PRODUCT_NUM": 0,
        "SERIAL_NUM": SERIAL_NUMBER,
        "BUS_TYPE": _bus,
        "COMPACT_DAQ_CHASSIS_DEV_NAME": _chassis,
        "COMPACT_DAQ_SLOT_NUM": lambda card: 1 if _chassis(card) else 0,
        "TERMINALS": lambda card: ", ".join(f"/{owner_of(card)}/{t}" for t in terminals(card)),
        "DIG_TRIG_SUPPORTED": True,
        "ANLG_TRIG_SUPPORTED": lambda card: bool(card.device.analog_triggers),
        "TIME_TRIG_SUPPORTED": False,
        "TEDS_HWTEDS_SUPPORTED": False,
        "NUM_TIME_TRIGS": 0,
        "NUM_DMA_CHANS": 0,
        "AI_TRIG_USAGE": _usage,
        "AI_PHYSICAL_CHANS": _inputs,
        "AI_SUPPORTED_MEAS_TYPES": _measurements,
        "AI_SAMP_MODES": [FINITE, CONTINUOUS],
        "AI_SIMULTANEOUS_SAMPLING_SUPPORTED": lambda card: card.device.simultaneous,
        "AI_MAX_SINGLE_CHAN_RATE": lambda card: card.device.fastest,
        "AI_MAX_MULTI_CHAN_RATE": lambda card: card.device.fastest_many,
        "AI_MIN_RATE": lambda card: card.device.slowest,
        "AI_NUM_SAMP_TIMING_ENGINES": 1,
        "AI_VOLTAGE_RNGS": lambda card: [
            volts for high in card.device.ranges for volts in (-high, high)
        ],
        "AI_CURRENT_INT_EXCIT_DISCRETE_VALS": lambda card: list(card.device.excitations),
        "AI_VOLTAGE_INT_EXCIT_DISCRETE_VALS": [],
        "AI_COUPLINGS": _couplings,
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
        "CHASSIS_MODULE_DEV_NAMES": lambda card: card.name,
        "TERMINALS": lambda card: ", ".join(f"/{owner_of(card)}/{t}" for t in terminals(card)),
        "DIG_TRIG_SUPPORTED": True,
        "AI_PHYSICAL_CHANS": "",
        **dict.fromkeys((name for name in _ABSENT if not name.startswith("CHASSIS")), ""),
    },
)


@dataclass(frozen=True)
class Chassis:
    """The chassis that holds a card."""

    card: Card


def _of_either(key: int) -> Attribute:
    def read(about: Card | Chassis) -> Any:
        owned, card = (_OF_CHASSIS, about.card) if isinstance(about, Chassis) else (_OF_CARD, about)
        if key not in owned:
            raise DaqmxError(-200197, f"Property {key:#x} is not supported by the device.")
        return owned[key].read(card)

    return Attribute(read)


DEVICE = {key: _of_either(key) for key in (*_OF_CARD, *_OF_CHASSIS)}
"""Properties of the card and of its `Chassis`."""

PHYSICAL_CHANNEL = table(
    "PHYSICALCHANNEL",
    {
        "PHYSICAL_CHAN_AI_SUPPORTED_MEAS_TYPES": _measurements,
        "PHYSICAL_CHAN_AI_TERM_CFGS": lambda card: sum(
            _CONFIGURATION_BITS[one] for one in card.device.configurations
        ),
        "PHYSICAL_CHAN_AI_INPUT_SRCS": "_external_channel",
    },
)

TASK = table(
    "TASK",
    {
        "NAME": lambda task: task.name,
        "CHANNELS": lambda task: ", ".join(task.channels),
        "DEVICES": lambda task: task.card.name if task.channels else "",
        "NUM_CHANS": lambda task: len(task.channels),
        "NUM_DEVICES": lambda task: 1 if task.channels else 0,
        "COMPLETE": lambda task: task.done,
    },
)
