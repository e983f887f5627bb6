"""One hardware-timed acquisition, finite or continuous, of any device, read in blocks."""

import time
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.daq.errors import DaqError
from sautereau.daq.file.recorded import Block
from sautereau.daq.source.connection import connect
from sautereau.daq.source.driver_faults import NOT_DONE, NOT_YET_AVAILABLE, told
from sautereau.daq.source.task import TaskSettings, build_task, plan_task, read_back
from sautereau.rig.acquisition import Daq

__all__ = ["Acquisition", "Block"]

PERIOD = 5e-3
"""s, after which it is asked again whether there are enough samples before the trigger."""


class Acquisition:
    """An acquisition of all channels of a rig's ``daq``.

    Use it as a context manager: entering builds the task, `start` arms it, `blocks` reads
    it, and leaving clears it by whatever way. Entered and not started, it is a dry run:
    `settings` tells what the device has taken.
    """

    def __init__(self, daq: Daq, duration_s: float | None, *, triggered: bool = True):
        """Prepare; the device is touched on entering.

        Args:
            daq: The acquisition as the rig describes it.
            duration_s: s, from the edge or the start on; rounded up to whole samples, 2 at least
                as the driver wants; None to go on until it is left.
            triggered: Whether the trigger's edge begins it, with ``daq.pre_trigger`` of what was
                before; else it begins with `start`.

        Raises:
            DaqError: No device could do that.
        """
        self._daq = daq
        self._plan = plan_task(daq, duration_s, triggered)
        self._stack = ExitStack()
        self._options: Any = None
        self._task: Any = None
        self._rate = daq.sample_rate
        self._simulated: bool | None = None
        self._description = ""

    @property
    def n_samples(self) -> int | None:
        """Samples of each channel, with those before the edge; None without an end."""
        return self._plan.total

    @property
    def rate(self) -> float:
        """Hz, of every channel, as the device runs; known once entered."""
        return self._rate

    @property
    def simulated(self) -> bool:
        """Whether the device itself says that it is simulated."""
        if self._simulated is None:
            raise DaqError("acquisition: not entered yet; ask for `simulated` inside `with`")
        return self._simulated

    @property
    def device_description(self) -> str:
        """Product type, serial number and name of the device; empty before entering."""
        return self._description

    def __enter__(self) -> "Acquisition":
        from nidaqmx import Task

        try:
            self._options = self._stack.enter_context(connect(self._daq, self._longest_wait))
            with told(self._daq, "setting up the task", self._options):
                self._task = Task(grpc_options=self._options)
                self._rate = build_task(self._task, self._plan)
            with told(self._daq, "identifying the device", self._options):
                self._describe_device()
        except BaseException as error:
            self._leave(error)
            raise
        return self

    def __exit__(self, _type: object, error: BaseException | None, _trace: object) -> None:
        self._leave(error)

    def settings(self) -> TaskSettings:
        """Return the task as the device has taken it and found it possible."""
        plan = self._plan
        with told(self._daq, "verifying the task", self._options):
            channels, buffer = read_back(self._entered(), plan)
        return TaskSettings(
            device=self._description,
            simulated=self.simulated,
            channels=channels,
            rate=self._rate,
            n_samples=plan.total,
            pre_trigger_samples=plan.before,
            buffer=buffer,
            block=self._daq.block,
            trigger=plan.trigger if plan.triggered else "",
        )

    def start(self) -> None:
        """Arm: from here on the trigger's edge begins the samples; without one they begin now.

        Returns when the samples that lie before the edge are there.
        """
        with told(self._daq, "arming", self._options):
            self._entered().start()
            if self._plan.before:
                self._await_pre_trigger()

    def stop(self) -> None:
        """End the acquisition, complete or not."""
        with told(self._daq, "stopping", self._options):
            self._entered().stop()

    def blocks(self) -> Iterator[Block]:
        """Yield the samples in blocks of ``daq.block``, those of a finite one all.

        With samples before the trigger's edge the first block begins there, below 0; the
        device gives them only when it has all samples. What came of a block before it failed
        is yielded before the error is raised.

        Raises:
            DaqError: The trigger or a later block did not come within
                ``daq.trigger_timeout``, samples were lost, or the device is gone.
        """
        from nidaqmx.stream_readers import AnalogMultiChannelReader

        daq, plan = self._daq, self._plan
        reader = AnalogMultiChannelReader(self._entered().in_stream)
        reader.verify_array_shape = False
        if plan.before:
            self._await_all()
        position = 0
        while plan.total is None or position < plan.total:
            n = daq.block if plan.total is None else min(daq.block, plan.total - position)
            volts = np.empty((len(daq.channels), n))
            with told(daq, "reading", self._options):
                count, late = self._read(reader, volts)
            if count:
                yield Block(position - plan.before, volts[:, :count])
            position += count
            if late is not None:
                raise self._too_late(position, n) from late
            if plan.total is None:
                self._must_stand_at(position)

    def _read(self, reader: Any, volts: NDArray[np.float64]) -> tuple[int, Exception | None]:
        """Fill ``volts``; return how many samples came, and why not all."""
        from nidaqmx.errors import DaqReadError

        n = volts.shape[1]
        try:
            count = reader.read_many_sample(volts, n, timeout=self._daq.trigger_timeout)
        except DaqReadError as error:
            if error.error_code != NOT_YET_AVAILABLE:
                raise
            return error.samps_per_chan_read, error
        if count != n:
            raise DaqError(
                f"DAQ device {self._daq.device}: a read of {n} samples gave {count}; press again"
            )
        return count, None

    def _too_late(self, there: int, n: int) -> DaqError:
        daq = self._daq
        if there == 0 and self._plan.triggered:
            return self._no_edge()
        of_all = "" if self._plan.total is None else f" of {self._plan.total}"
        return DaqError(
            f"DAQ device {daq.device}: the samples stopped at {there}{of_all}:"
            f" no whole block within {daq.trigger_timeout:g} s; raise daq.trigger_timeout"
            f" above the {n / self._rate:.3g} s of a block, or see whether the device is"
            " still plugged in"
        )

    def _no_edge(self) -> DaqError:
        daq = self._daq
        return DaqError(
            f"DAQ device {daq.device}: no edge on {self._plan.trigger}"
            f" within {daq.trigger_timeout:g} s of waiting; see that the cable runs from"
            " the controller's output controller.trigger_output to that terminal, that"
            " the controller has started the press, and that daq.trigger_source names"
            " the terminal"
        )

    def _must_stand_at(self, position: int) -> None:
        """Refuse to go on where the driver has passed over samples."""
        with told(self._daq, "reading", self._options):
            there = self._entered().in_stream.curr_read_pos
        if there != position:
            raise DaqError(
                f"DAQ device {self._daq.device}: {there - position} samples were lost before sample"
                f" {there}; free the machine, or lower daq.sample_rate, and record again"
            )

    def _await_pre_trigger(self) -> None:
        daq, stream = self._daq, self._task.in_stream
        end = time.monotonic() + daq.pre_trigger + daq.trigger_timeout
        while (there := stream.total_samp_per_chan_acquired) < self._plan.before:
            if time.monotonic() > end:
                raise DaqError(
                    f"DAQ device {daq.device}: {there} samples after"
                    f" {daq.pre_trigger + daq.trigger_timeout:g} s, and daq.pre_trigger needs"
                    f" {self._plan.before}; see whether the device is still plugged in"
                )
            time.sleep(PERIOD)

    def _await_all(self) -> None:
        """Wait for the last sample: before it none can be read of an acquisition around an edge."""
        from nidaqmx.errors import DaqError as DriverError

        with told(self._daq, "waiting for the trigger", self._options):
            try:
                self._entered().wait_until_done(self._longest_wait)
            except DriverError as error:
                if error.error_code != NOT_DONE:
                    raise
                raise self._no_edge() from error

    @property
    def _longest_wait(self) -> float:
        """s, for which a call may wait for samples."""
        plan, daq = self._plan, self._daq
        if plan.before and plan.after is not None:
            return daq.trigger_timeout + plan.after / daq.sample_rate
        return daq.trigger_timeout

    def _entered(self) -> Any:
        if self._task is None:
            raise DaqError(
                "acquisition: no task; use it inside `with Acquisition(...) as acquisition:`"
            )
        return self._task

    def _describe_device(self) -> None:
        (device,) = self._task.devices
        self._simulated = bool(device.is_simulated)
        self._description = (
            f"{device.product_type}, serial number {device.serial_num:08X}, {self._daq.device}"
        )

    def _leave(self, first: BaseException | None) -> None:
        """Clear the task and the connection; a failure here never hides ``first``."""
        task, self._task = self._task, None
        try:
            with self._stack:
                if task is not None:
                    with told(self._daq, "clearing the task", self._options):
                        task.close()
        except DaqError as error:
            if first is None:
                raise
            first.add_note(f"then the task could not be cleared either: {error}")
