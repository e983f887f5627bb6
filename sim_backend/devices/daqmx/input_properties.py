"""The properties of a channel."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from sautereau.sim_backend.device_types import AC, DC, IDEAL
from sautereau.sim_backend.devices.daqmx.attributes import (
    Attribute,
    field,
    kept,
    number,
    stored,
    table,
)
from sautereau.sim_backend.devices.daqmx.card import DaqmxError
from sautereau.sim_backend.devices.daqmx.inputs import INTERNAL, NO_EXCITATION, Input
from sautereau.sim_backend.devices.daqmx.progress import CardTask

_ANALOG_INPUT = 10100
_SECONDS, _PERIODS, _EXTERNAL = 10364, 10286, 10167
_RIGHT, _DMA, _NO_COMPRESSION, _USE_CURRENT, _USE_DC = 10279, 10054, 10230, 10134, 10050
_IEPE = (10356, 15966, 15895, 10354)


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
    if not any(seat.task.device.filter_delay):
        raise DaqmxError(-200452, "The device has no digital filter with a delay.")


def _has_excitation(seat: Seat) -> None:
    if not seat.task.device.excitations and _EXCITATION not in seat.stored:
        raise DaqmxError(-200452, "The device supplies no excitation.")


def _filter_delay(seat: Seat) -> float:
    _has_filter(seat)
    rate = seat.task.rate or 1000.0
    samples, seconds = seat.task.device.filter_delay
    delay = samples / rate + seconds
    return delay * rate if seat.stored.get(_UNITS) == _PERIODS else delay


def _configuration(seat: Seat) -> int:
    seat.input.verify()
    given = seat.input.configuration
    return seat.task.device.configurations[0] if given == -1 else given


def _of_input(name: str, default: object, read: Callable[[Seat], object]) -> Attribute:
    return field(name, default, read, of=lambda seat: seat.input)


def _limit(name: str, sign: int) -> Attribute:
    return _of_input(
        name,
        math.nan,  # must be set before it is read
        lambda seat: sign * seat.input.range / abs(seat.input.volts_per_unit) + seat.input.zero,
    )


def _unscale(seat: Seat) -> None:
    seat.must_be_idle()
    seat.input.custom_scale, seat.input.volts_per_unit, seat.input.zero = "", 1.0, 0.0


def _scaling(seat: Seat) -> list[float]:
    if seat.task.device is IDEAL:
        raise DaqmxError(-200452, "An ideal device has no converter.")
    return [0.0, seat.input.step, 0.0, 0.0]


def _coupling(seat: Seat) -> int:
    couplings = seat.task.device.couplings
    return AC if AC in couplings and seat.input.measurement in _IEPE else DC


def _sources(seat: Seat) -> tuple[int, ...]:
    internal = (INTERNAL,) if seat.task.device.excitations else ()
    return *internal, _EXTERNAL, NO_EXCITATION


_UNITS = number("CHANNEL", "AI_FILTER_DELAY_UNITS")
_EXCITATION = number("CHANNEL", "AI_EXCIT_VAL")
_CHOICES: dict[str, tuple[Any, ...]] = {
    "AI_COUPLING": (_coupling, lambda seat: seat.task.device.couplings),
    "AI_EXCIT_SRC": (NO_EXCITATION, _sources),
    "AI_EXCIT_VAL": (0.0, lambda seat: (0.0, *seat.task.device.excitations), _has_excitation),
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
            "AI_LOSSY_LSB_REMOVAL_COMPRESSED_SAMP_SIZE": lambda seat: seat.task.device.raw_bits,
            "AI_ENHANCED_ALIAS_REJECTION_ENABLE": False,
            "AI_ATTEN": 0.0,
            "AI_GAIN": 1.0,
        },
    ),
    **table(
        "CHANNEL",
        {
            "CHAN_TYPE": _ANALOG_INPUT,
            "PHYSICAL_CHAN_NAME": lambda seat: f"{seat.task.card.name}/{seat.input.terminal}",
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
            "AI_RAW_SAMP_SIZE": lambda seat: seat.task.device.raw_bits,
            "AI_RAW_SAMP_JUSTIFICATION": _RIGHT,
            "AI_DEV_SCALING_COEFF": _scaling,
        },
    ),
}
