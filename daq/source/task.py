"""The task on the DAQ device that an acquisition runs: wanted, built, and read back."""

import math
from dataclasses import dataclass
from typing import Any

from sautereau.daq.errors import DaqError
from sautereau.rig.acquisition import Daq

RATE_TOLERANCE = 1e-2
"""1, largest relative difference between the rate asked for and the device's own."""
BUFFER = 10.0
"""s of samples, which a continuous acquisition may be behind before any is lost."""
READS = (10.0, 100.0)
"""1/s, fewest and most reads: fewer lose more with a killed process, more lose samples to the
work of reading."""
LEAST = 2
"""Samples, fewest of a finite acquisition, and fewest before an edge and from it on."""


@dataclass(frozen=True)
class TaskPlan:
    """What is asked of the device, in whole samples; make one with `plan_task`."""

    daq: Daq
    triggered: bool
    """Whether the edge of the trigger's terminal begins it; else it begins when started."""
    before: int
    """Samples of each channel before that edge."""
    after: int | None
    """Samples of each channel from there on; None where it goes on until it is stopped."""

    @property
    def total(self) -> int | None:
        """Samples of each channel; None where it goes on until it is stopped."""
        return None if self.after is None else self.before + self.after

    @property
    def buffer(self) -> int:
        """Samples of each channel that are kept for reading."""
        return self.total or math.ceil(BUFFER * self.daq.sample_rate)

    @property
    def trigger(self) -> str:
        """Terminal of the trigger, with the device."""
        return f"/{self.daq.device}/{self.daq.trigger_source}"


def plan_task(daq: Daq, duration_s: float | None, triggered: bool) -> TaskPlan:
    """Count the samples of an acquisition.

    Args:
        daq: The acquisition as the rig describes it.
        duration_s: s, from the edge or the start on; None to go on until it is stopped.
        triggered: Whether the trigger's edge begins it.

    Raises:
        DaqError: No device could do it, or it would be read too often or too seldom.
    """
    faults = []
    rate = daq.sample_rate
    if duration_s is not None and not (math.isfinite(duration_s) and duration_s > 0):
        faults.append(
            f"acquisition of {duration_s:g} s: the duration must be a number above 0 s; give one,"
            " or none to go on until it is stopped"
        )
        duration_s = None
    elif duration_s is None and triggered and daq.pre_trigger:
        faults.append(
            f"daq.pre_trigger: {daq.pre_trigger:g} s before the edge are kept of an acquisition"
            " with an end only; give a duration, set it to 0 s, or start without the trigger"
        )
    reads = rate / daq.block
    if not READS[0] <= reads <= READS[1]:
        faults.append(
            f"daq.block: {daq.block} samples at {rate:.6g} Hz make {reads:.4g} reads a second, not"
            f" {READS[0]:g} to {READS[1]:g}; set it from {math.ceil(rate / READS[1])} to"
            f" {math.floor(rate / READS[0])}"
        )
    if faults:
        raise DaqError("\n".join(faults))
    before = _samples(daq.pre_trigger, rate) if triggered and daq.pre_trigger else 0
    after = None if duration_s is None else _samples(duration_s, rate)
    return TaskPlan(daq, triggered, before, after)


def _samples(seconds: float, rate: float) -> int:
    # The product's last digits are noise of binary fractions, not another sample.
    return max(LEAST, math.ceil(round(seconds * rate, 6)))


def build_task(task: Any, plan: TaskPlan) -> float:
    """Give a new nidaqmx task its channels, clock, trigger and buffer.

    Returns:
        Hz, the rate at which the device will really sample.
    """
    from nidaqmx.constants import AcquisitionType, Edge, ReadRelativeTo

    daq = plan.daq
    for channel in daq.channels:
        task.ai_channels.add_ai_voltage_chan(
            f"{daq.device}/{channel.terminal}",
            channel.name,
            min_val=-channel.range,
            max_val=channel.range,
        )
    task.timing.cfg_samp_clk_timing(
        daq.sample_rate,
        sample_mode=AcquisitionType.CONTINUOUS if plan.total is None else AcquisitionType.FINITE,
        samps_per_chan=plan.buffer,
    )
    if plan.before:
        task.triggers.reference_trigger.cfg_dig_edge_ref_trig(
            plan.trigger, plan.before, Edge.RISING
        )
        # By default every read would begin anew at the first sample before the trigger.
        task.in_stream.relative_to = ReadRelativeTo.CURRENT_READ_POSITION
    elif plan.triggered:
        task.triggers.start_trigger.cfg_dig_edge_start_trig(plan.trigger, Edge.RISING)
    task.in_stream.input_buf_size = plan.buffer
    rate = task.timing.samp_clk_rate
    if abs(rate / daq.sample_rate - 1) > RATE_TOLERANCE:
        raise DaqError(
            f"DAQ device {daq.device}: it runs at {rate:.9g} Hz, not at the"
            f" {daq.sample_rate:.9g} Hz asked for; set daq.sample_rate to a rate it has"
        )
    return rate


@dataclass(frozen=True)
class ChannelSettings:
    """One input as the device has taken it."""

    name: str
    terminal: str
    """With the device: ``Dev1/ai0``."""
    sensor: str
    range: float
    """V, largest magnitude asked for."""
    device_low: float
    """V, least that the device's input range holds."""
    device_high: float
    """V, largest that the device's input range holds."""


@dataclass(frozen=True)
class TaskSettings:
    """A task as the device has taken it: what a dry run shows."""

    device: str
    """Product type, serial number and name."""
    simulated: bool
    channels: tuple[ChannelSettings, ...]
    rate: float
    """Hz, of every channel."""
    n_samples: int | None
    """Of each channel; None where it goes on until it is stopped."""
    pre_trigger_samples: int
    """Of each channel, those of them before the edge."""
    buffer: int
    """Samples of each channel."""
    block: int
    """Samples of each channel read at a time."""
    trigger: str
    """Terminal whose rising edge begins it; empty where it begins at once."""


def read_back(task: Any, plan: TaskPlan) -> tuple[tuple[ChannelSettings, ...], int]:
    """Return the channels and the buffer (samples) that the device has taken, verified by it."""
    from nidaqmx.constants import TaskMode

    task.control(TaskMode.TASK_VERIFY)
    taken = []
    for channel in plan.daq.channels:
        there = task.ai_channels[channel.name]
        taken.append(
            ChannelSettings(
                channel.name,
                there.physical_channel.name,
                channel.sensor,
                channel.range,
                there.ai_rng_low,
                there.ai_rng_high,
            )
        )
    return tuple(taken), task.in_stream.input_buf_size
