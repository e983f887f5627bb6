"""The analog inputs of a task: configured as the rig requests, and read back from the device.

NI-DAQmx's reference of properties describes each property under the name given here. A device that
does not have a property refuses it with one of the codes `NOT_SUPPORTED`.
"""

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from sautereau.daq.errors import DaqError
from sautereau.daq.file.samples import Scaling
from sautereau.daq.source.source import InputSettings
from sautereau.rig.acquisition import Channel, Daq

NOT_SUPPORTED = (-200197, -200452)
"""Codes of the error if the device or the task does not have a property."""
LONGEST_DELAY = 1.0  # s, of an input's digital filter; those of cards take less than 0.1 s

COUNTS = {16: "int16", 32: "int32"}  # Type of the counts, by their bits
COUNTS_REACH = (0.9, 1.5)
"""Dimensionless, smallest and largest volts of the extreme counts, as a fraction of the range."""


def add_input(task: Any, daq: Daq, channel: Channel) -> None:
    """Add one input to a nidaqmx task, configured as the rig requests."""
    from nidaqmx.constants import (
        Coupling,
        ExcitationSource,
        ExcitationVoltageOrCurrent,
        TerminalConfiguration,
    )

    added = task.ai_channels.add_ai_voltage_chan(
        daq.physical(channel),
        channel.name,
        terminal_config=TerminalConfiguration[channel.terminal_configuration.upper()],
        min_val=-channel.range,
        max_val=channel.range,
    )
    if channel.input_coupling != "default":
        added.ai_coupling = Coupling[channel.input_coupling.upper()]
    if channel.excitation:
        added.ai_excit_src = ExcitationSource.INTERNAL
        added.ai_excit_voltage_or_current = ExcitationVoltageOrCurrent.USE_CURRENT
        added.ai_excit_val = channel.excitation


def read_inputs(task: Any, daq: Daq) -> tuple[InputSettings, ...]:
    """Return the inputs as the device has accepted and verified them.

    Raises:
        DaqError: Some input differs from the rig's request.
    """
    skew = {device.name: _skew(task, device) for device in task.devices}
    # Each device converts its own inputs, in the order of the task.
    places = Counter[str]()
    found = []
    for channel in daq.channels:
        device = daq.device_of(channel)
        found.append(_read_input(task, channel, places[device] * skew.get(device, 0.0)))
        places[device] += 1
    settings = tuple(found)
    faults = [
        fault
        for channel, actual in zip(daq.channels, settings, strict=True)
        for fault in _impossible(actual, daq.sample_rate) or _differences(channel, actual)
    ]
    if faults:
        raise DaqError("\n".join(f"DAQ device {daq.device}: {fault}" for fault in faults))
    return settings


def read_scaling(task: Any, inputs: Sequence[InputSettings]) -> Scaling | None:
    """Return the scaling of the inputs' counts; None if the device gives volts only.

    ``AI.DevScalingCoeff`` is the polynomial by which the driver itself converts counts to volts.
    If the polynomial of an input does not reach its range, the counts that are read are not the
    signed ones of this polynomial, and the result is None.
    """
    from nidaqmx.constants import DataJustification

    sizes, rows = set(), []
    for settings in inputs:
        channel = task.ai_channels[settings.name]
        size = _optional(channel, "ai_raw_samp_size")
        bits = _optional(channel, "ai_resolution")
        coefficients = list(_optional(channel, "ai_dev_scaling_coeff") or ())
        if size not in COUNTS or not bits or not coefficients:
            return None
        left = _optional(channel, "ai_raw_samp_justification") == DataJustification.LEFT
        ends = np.array([-1.0, 1.0]) * 2.0 ** ((size if left else bits) - 1)
        with np.errstate(all="ignore"):  # what is not finite is not within the range below
            reached = np.polynomial.polynomial.polyval(ends, coefficients)
        ratios = reached / [settings.device_low, settings.device_high]
        if not ((ratios > COUNTS_REACH[0]) & (ratios < COUNTS_REACH[1])).all():
            return None
        sizes.add(size)
        rows.append(coefficients)
    if len(sizes) != 1:
        return None
    length = max(map(len, rows))
    padded = np.array([[*row, *[0.0] * (length - len(row))] for row in rows])
    return Scaling(COUNTS[sizes.pop()], padded)


def _read_input(task: Any, channel: Channel, skew: float) -> InputSettings:
    actual = task.ai_channels[channel.name]
    configuration = _optional(actual, "ai_term_cfg")
    coupling = _optional(actual, "ai_coupling")
    return InputSettings(
        name=channel.name,
        terminal=actual.physical_channel.name,
        sensor=channel.sensor,
        range=channel.range,
        device_low=actual.ai_rng_low,
        device_high=actual.ai_rng_high,
        terminal_configuration=configuration and configuration.name.lower(),
        coupling=coupling and coupling.name.lower(),
        excitation=_optional(actual, "ai_excit_val") if channel.excitation else None,
        delay=_filter_delay(task, actual) - skew,
    )


def _filter_delay(task: Any, channel: Any) -> float:
    """Return the delay of the samples after the input, s; 0 if the driver removes it.

    This is ``AI.FilterDelay``. Its unit is ``AI.FilterDelayUnits``, or seconds without one.
    """
    from nidaqmx.constants import DigitalWidthUnits

    delay = _optional(channel, "ai_filter_delay")
    if not delay or _optional(channel, "ai_remove_filter_delay"):
        return 0.0
    unit = _optional(channel, "ai_filter_delay_units")
    if unit == DigitalWidthUnits.SAMPLE_CLOCK_PERIODS:
        return delay / task.timing.samp_clk_rate
    return delay


def _skew(task: Any, device: Any) -> float:
    """Return the time between a multiplexer's samples of two consecutive inputs, s.

    It converts the inputs in the order of the task, at ``AIConv.Rate``.
    """
    if _optional(device, "ai_simultaneous_sampling_supported") in (None, True):
        return 0.0
    # A task of one device refuses some properties for a device (NI-DAQmx, "active device").
    timing = task.timing if len(task.devices) == 1 else task.timing[device]
    rate = _optional(timing, "ai_conv_rate")
    if not rate:
        return 0.0
    return 1 / rate if rate > 0 else math.inf  # a delay that is refused with its input


def _impossible(actual: InputSettings, rate: float) -> list[str]:
    """Return which numbers of an input's answers no input can have at a sample rate (Hz)."""
    faults = {
        name: "is not a finite number"
        for name, value in vars(actual).items()
        if isinstance(value, float) and not math.isfinite(value)
    }
    # Between its least, the last conversion of a multiplexer, and that of a slow digital filter.
    if "delay" not in faults and not -1 / rate < actual.delay <= LONGEST_DELAY:
        faults["delay"] = f"is not within {-1 / rate:g} s and {LONGEST_DELAY:g} s"
    return [
        f"input {actual.terminal} ({actual.name}): the driver gives {name} ="
        f" {getattr(actual, name)}, which {fault}; update the driver"
        for name, fault in faults.items()
    ]


def _differences(channel: Channel, actual: InputSettings) -> list[str]:
    """Return what differs from the request in a way that would make the samples wrong."""
    who = f"input {actual.terminal} ({channel.name})"
    found = []
    if min(-actual.device_low, actual.device_high) < channel.range:
        found.append(
            f"{who} takes {actual.device_low:g} to {actual.device_high:g} V, less than the"
            f" requested +-{channel.range:g} V; lower daq.channels.{channel.name}.range, or use"
            " an attenuator"
        )
    for what, requested, accepted in (
        ("terminal_configuration", channel.terminal_configuration, actual.terminal_configuration),
        ("input_coupling", channel.input_coupling, actual.coupling),
    ):
        if requested != "default" and accepted not in (None, requested):
            found.append(
                f"{who} is set to {what} = {accepted}, not the requested {requested}; set it to one"
                " that the device supports"
            )
    if actual.excitation is not None and not math.isclose(
        actual.excitation, channel.excitation, rel_tol=0.1
    ):
        found.append(
            f"{who} supplies {actual.excitation * 1e3:g} mA instead of the requested"
            f" {channel.excitation * 1e3:g} mA; set excitation to what the device supplies"
        )
    return found


def _optional(owner: Any, name: str) -> Any:
    """Return a property of a nidaqmx object; None if the device does not have it."""
    from nidaqmx.errors import DaqError as DriverError

    try:
        return getattr(owner, name)
    except DriverError as error:
        if error.error_code not in NOT_SUPPORTED:
            raise
        return None
