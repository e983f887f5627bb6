"""One hardware-timed acquisition: armed, started by the controller's edge, read in blocks."""

import math
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from daq.block import Block
from daq.connection import NOT_YET_AVAILABLE, connect, told
from daq.errors import DaqError
from rig.schema import Daq

__all__ = ["Acquisition", "Block"]

RATE_TOLERANCE = 1e-2
"""1, largest relative difference between the rate asked for and the device's own."""


class Acquisition:
    """A finite acquisition of all channels of a rig's ``daq``, started by its trigger.

    Use it as a context manager: entering builds the task, `start` arms it, `blocks` reads
    it, and leaving clears it by whatever way.
    """

    def __init__(self, daq: Daq, duration_s: float):
        """Prepare; the device is touched on entering.

        Args:
            daq: The acquisition as the rig describes it.
            duration_s: s, from the trigger's edge; rounded up to whole samples, 2 at least as
                the driver wants.
        """
        if not (math.isfinite(duration_s) and duration_s > 0):
            raise DaqError(
                f"acquisition of {duration_s:g} s: the duration must be a number above 0 s"
            )
        self._daq = daq
        # The product's last digits are noise of binary fractions, not another sample.
        self._n_samples = max(2, math.ceil(round(duration_s * daq.sample_rate, 6)))
        self._stack = ExitStack()
        self._options: Any = None
        self._task: Any = None
        self._rate = daq.sample_rate
        self._simulated: bool | None = None
        self._description = ""

    @property
    def n_samples(self) -> int:
        """Samples of each channel."""
        return self._n_samples

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
        try:
            self._options = self._stack.enter_context(connect(self._daq))
            self._describe_device()
            self._build_task()
        except BaseException as error:
            self._leave(error)
            raise
        return self

    def __exit__(self, _type: object, error: BaseException | None, _trace: object) -> None:
        self._leave(error)

    def start(self) -> None:
        """Arm: from here on the trigger's edge starts the samples."""
        with told(self._daq, "arming", self._options):
            self._entered().start()

    def stop(self) -> None:
        """End the acquisition, complete or not."""
        with told(self._daq, "stopping", self._options):
            self._entered().stop()

    def blocks(self) -> Iterator[Block]:
        """Yield all samples in blocks of ``daq.block``, the last one shorter.

        Raises:
            DaqError: The trigger or a later block did not come within
                ``daq.trigger_timeout``, samples were lost, or the device is gone.
        """
        from nidaqmx.stream_readers import AnalogMultiChannelReader

        daq = self._daq
        reader = AnalogMultiChannelReader(self._entered().in_stream)
        reader.verify_array_shape = False
        for first in range(0, self._n_samples, daq.block):
            n = min(daq.block, self._n_samples - first)
            volts = np.empty((len(daq.channels), n))
            with told(daq, "reading", self._options):
                self._read(reader, volts, first, n)
            yield Block(first, volts)

    def _read(self, reader: Any, volts: NDArray[np.float64], first: int, n: int) -> None:
        from nidaqmx.errors import DaqReadError

        daq = self._daq
        try:
            count = reader.read_many_sample(volts, n, timeout=daq.trigger_timeout)
        except DaqReadError as error:
            if error.error_code != NOT_YET_AVAILABLE:
                raise
            there = first + error.samps_per_chan_read
            if there == 0:
                raise DaqError(
                    f"DAQ device {daq.device}: no edge on /{daq.device}/{daq.trigger_source}"
                    f" within {daq.trigger_timeout:g} s of waiting; see that the cable runs from"
                    " the controller's output controller.trigger_output to that terminal, that"
                    " the controller has started the press, and that daq.trigger_source names"
                    " the terminal"
                ) from error
            raise DaqError(
                f"DAQ device {daq.device}: the samples stopped at {there} of {self._n_samples}:"
                f" no whole block within {daq.trigger_timeout:g} s; raise daq.trigger_timeout"
                f" above the {n / self._rate:.3g} s of a block, or see whether the device is"
                " still plugged in"
            ) from error
        if count != n:
            raise DaqError(
                f"DAQ device {daq.device}: a read of {n} samples gave {count} at sample {first};"
                " press again"
            )

    def _entered(self) -> Any:
        if self._task is None:
            raise DaqError(
                "acquisition: no task; use it inside `with Acquisition(...) as acquisition:`"
            )
        return self._task

    def _describe_device(self) -> None:
        with told(self._daq, "identifying the device", self._options):
            from nidaqmx.system import Device

            device = Device(self._daq.device, grpc_options=self._options)
            self._simulated = bool(device.is_simulated)
            self._description = (
                f"{device.product_type}, serial number {device.serial_num:08X}, {self._daq.device}"
            )

    def _build_task(self) -> None:
        daq = self._daq
        with told(daq, "setting up the task", self._options):
            from nidaqmx import Task
            from nidaqmx.constants import AcquisitionType, Edge

            task = self._task = Task(grpc_options=self._options)
            for channel in daq.channels:
                task.ai_channels.add_ai_voltage_chan(
                    f"{daq.device}/{channel.terminal}",
                    channel.name,
                    min_val=-channel.range,
                    max_val=channel.range,
                )
            task.timing.cfg_samp_clk_timing(
                daq.sample_rate,
                sample_mode=AcquisitionType.FINITE,
                samps_per_chan=self._n_samples,
            )
            task.triggers.start_trigger.cfg_dig_edge_start_trig(
                f"/{daq.device}/{daq.trigger_source}", Edge.RISING
            )
            task.in_stream.input_buf_size = self._n_samples
            self._rate = task.timing.samp_clk_rate
        if abs(self._rate / daq.sample_rate - 1) > RATE_TOLERANCE:
            raise DaqError(
                f"DAQ device {daq.device}: it runs at {self._rate:.9g} Hz, not at the"
                f" {daq.sample_rate:.9g} Hz asked for; set daq.sample_rate to a rate it has"
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
