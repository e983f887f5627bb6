"""The task on the DAQ device that an acquisition runs: planned, built, its samples counted.

Their number dates the trigger.
"""

import math
import time
from dataclasses import dataclass, replace
from typing import Any

from sautereau.daq.errors import DaqError
from sautereau.daq.file.trigger_date import Counted
from sautereau.daq.source.driver_faults import NOT_DONE
from sautereau.rig.acquisition import Daq

READS = (10.0, 100.0)
"""Smallest and largest number of reads per second, 1/s. With fewer, a killed process loses more
samples; with more, the reading is too slow."""
PERIOD = 2e-3
"""Interval of polling while samples around the trigger are awaited, s: a start trigger lies between
two polls."""
DATING = 0.05
"""Largest time in s between the trigger and the counts that date it: several polls. The clocks of
host and device differ by about 50 ppm, in this time by less than a sample."""


@dataclass(frozen=True)
class TaskPlan:
    """What is requested of the device, in samples; make one with `plan_task`."""

    daq: Daq
    triggered: bool
    """Whether the edge at the trigger's terminal starts it; else starting the task does."""
    before: int
    """Samples of each channel before that edge."""
    after: int | None
    """Samples of each channel after it; None to continue until it is stopped."""

    @property
    def total(self) -> int | None:
        """Samples of each channel; None to continue until it is stopped."""
        return None if self.after is None else self.before + self.after

    @property
    def buffer(self) -> int:
        """Samples of each channel that the buffer holds; of a continuous acquisition, 10 s of them,
        the longest delay of reading."""
        return self.total or math.ceil(10.0 * self.daq.sample_rate)


def plan_task(daq: Daq, duration_s: float | None, triggered: bool) -> TaskPlan:
    """Count the samples of an acquisition.

    Args:
        duration_s: Duration after the edge or the start, s; None to continue until stopped.

    Raises:
        DaqError: The settings are impossible for any device, or too many or too few reads per
            second.
    """
    faults = []
    rate = daq.sample_rate
    if duration_s is not None and not (math.isfinite(duration_s) and duration_s > 0):
        faults.append(
            f"acquisition of {duration_s:g} s: the duration must be a number above 0 s; give one,"
            " or none to continue until it is stopped"
        )
        duration_s = None
    elif duration_s is None and triggered and daq.pre_trigger:
        faults.append(
            f"daq.pre_trigger: {daq.pre_trigger:g} s before the edge require a finite acquisition;"
            " give a duration, set it to 0 s, or start without the trigger"
        )
    reads = rate / daq.block
    if not READS[0] <= reads <= READS[1]:
        faults.append(
            f"daq.block: {daq.block} samples at {rate:.6g} Hz make {reads:.4g} reads per second,"
            f" not {READS[0]:g} to {READS[1]:g}; set it to a value from"
            f" {math.ceil(rate / READS[1])} to {math.floor(rate / READS[0])}"
        )
    if faults:
        raise DaqError("\n".join(faults))
    before = _samples(daq.pre_trigger, rate) if triggered and daq.pre_trigger else 0
    after = None if duration_s is None else _samples(duration_s, rate)
    return TaskPlan(daq, triggered, before, after)


def _samples(seconds: float, rate: float) -> int:
    # Rounded first: the last digits of the product are rounding errors, not another sample.
    return max(2, math.ceil(round(seconds * rate, 6)))


def build_task(task: Any, plan: TaskPlan, trigger: str) -> float:
    """Give a nidaqmx task with its inputs clock, trigger and buffer.

    Args:
        trigger: Terminal of the trigger's edge, with its device.

    Returns:
        Actual sampling rate of the device, Hz.
    """
    from nidaqmx.constants import AcquisitionType, Edge, ReadRelativeTo

    daq = plan.daq
    task.timing.cfg_samp_clk_timing(
        daq.sample_rate,
        sample_mode=AcquisitionType.CONTINUOUS if plan.total is None else AcquisitionType.FINITE,
        samps_per_chan=plan.buffer,
    )
    edge = Edge[daq.trigger_edge.upper()]
    if plan.before:
        task.triggers.reference_trigger.cfg_dig_edge_ref_trig(trigger, plan.before, edge)
        # By default every read would start at the first sample before the trigger again.
        task.in_stream.relative_to = ReadRelativeTo.CURRENT_READ_POSITION
    elif plan.triggered:
        task.triggers.start_trigger.cfg_dig_edge_start_trig(trigger, edge)
    task.in_stream.input_buf_size = plan.buffer
    return accepted_rate(task.timing.samp_clk_rate, daq)


def trigger_terminal(daq: Daq, options: Any) -> str:
    """Return the trigger's terminal with its device: ``/Dev1/PFI0``.

    A module of a CompactDAQ chassis has no trigger terminals; the terminal of its chassis is used,
    and the driver routes it to every module of the task. A complete name, which starts with a
    slash, is returned unchanged.

    Args:
        options: Options of the gRPC session; None for the driver of this machine.
    """
    from nidaqmx.constants import ProductCategory
    from nidaqmx.system import Device

    if daq.trigger_source.startswith("/"):
        return daq.trigger_source
    device = Device(daq.device, grpc_options=options)
    owner = daq.device
    if device.product_category == ProductCategory.C_SERIES_MODULE:
        owner = device.compact_daq_chassis_device.name
    return f"/{owner}/{daq.trigger_source}"


def accepted_rate(rate: float, daq: Daq) -> float:
    """Return the actual sampling rate of a device, Hz, if it is about the requested one.

    Raises:
        DaqError: It is not.
    """
    if not abs(rate / daq.sample_rate - 1) <= 1e-2:  # it may be NaN
        raise DaqError(
            f"DAQ device {daq.device}: it runs at {rate:.9g} Hz instead of the requested"
            f" {daq.sample_rate:.9g} Hz; set daq.sample_rate to a rate that it supports"
        )
    return rate


class SampleCounter:
    """Counts the samples of a nidaqmx task."""

    def __init__(self, task: Any, plan: TaskPlan):
        self._task, self._plan = task, plan
        self._counts: list[Counted] = []

    def count(self) -> Counted:
        """Return the samples acquired since the start."""
        asked = time.perf_counter()
        acquired = self._task.in_stream.total_samp_per_chan_acquired
        answered = time.perf_counter()
        if self._plan.total is not None and acquired >= self._plan.total and not self._plan.before:
            asked = -math.inf  # it does not say how long ago the last one was acquired
        return Counted(asked, answered, acquired)

    def start(self) -> None:
        """Start the task."""
        asked = time.perf_counter()
        self._task.start()
        self._counts = [Counted(asked, math.inf, 0)]

    def await_first(self) -> tuple[Counted, ...]:
        """Wait for the first sample after the edge, at most ``daq.trigger_timeout``.

        Returns:
            The last count without a sample, if any, and the first one with samples, if any.
        """
        if self._plan.triggered:
            end = time.perf_counter() + self._plan.daq.trigger_timeout
            while (found := self.count()).stop == 0 and found.answered < end:
                self._counts = [found]
                time.sleep(PERIOD)
            self._counts.append(found)
        return tuple(self._counts)

    def await_pre_trigger(self) -> None:
        """Wait until the samples before the edge are acquired.

        Raises:
            DaqError: They are not within ``daq.trigger_timeout``.
        """
        daq, before = self._plan.daq, self._plan.before
        longest = daq.pre_trigger + daq.trigger_timeout
        end = time.perf_counter() + longest
        while (held := self._counts[-1].stop) < before:
            if time.perf_counter() > end:
                raise DaqError(
                    f"DAQ device {daq.device}: {held} samples after {longest:g} s, but"
                    f" daq.pre_trigger needs {before}; check whether the device is still plugged in"
                )
            time.sleep(PERIOD)
            self._counts.append(self.count())

    def await_all(self, longest: float) -> tuple[Counted, ...]:
        """Wait for the last sample; with a pre-trigger the driver returns no sample earlier.

        Args:
            longest: Longest wait, s.

        Returns:
            Counts during the wait, relative to the edge, which precedes the last sample by the
            requested number of samples; empty if there was no edge.
        """
        after, not_done = self._plan.after or 0, -math.inf
        end = (asked := time.perf_counter()) + longest
        while not self._done():
            if asked > end:
                return ()
            not_done = asked
            self._counts.append(self.count())
            asked = time.perf_counter()
        done = Counted(-math.inf, time.perf_counter(), after)
        edge = self.count().stop - after
        if edge <= self._plan.before:  # it may not count the samples that it drops
            return done, Counted(not_done, math.inf, after - 1)
        since_edge = [replace(one, stop=one.stop - edge) for one in self._counts]
        first, limit = since_edge[0].stop, DATING * self._plan.daq.sample_rate
        last_before = max((one.stop for one in since_edge if one.stop <= 0), default=first)
        near = (one for one in since_edge if min(-limit, last_before) <= one.stop <= limit)
        return (done, *near)

    def _done(self) -> bool:
        """Return whether the last sample is acquired, after waiting `PERIOD` for it."""
        from nidaqmx.errors import DaqError as DriverError

        try:
            self._task.wait_until_done(PERIOD)
        except DriverError as error:
            if error.error_code != NOT_DONE:
                raise
            return False
        return True
