"""A hardware-timed acquisition, finite or continuous, with any NI-DAQmx device, read in blocks."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sautereau.daq.errors import DaqError
from sautereau.daq.file.recorded import Block
from sautereau.daq.file.samples import Scaling
from sautereau.daq.file.trigger_date import Counted
from sautereau.daq.source.connection import connect, create_task
from sautereau.daq.source.driver_faults import NOT_YET_AVAILABLE, driver_errors
from sautereau.daq.source.inputs import add_input, read_inputs, read_scaling
from sautereau.daq.source.source import InputSettings, SourceSettings
from sautereau.daq.source.task import DATING, SampleCounter, build_task, plan_task, trigger_terminal
from sautereau.rig.acquisition import Daq
from sautereau.rig.schema import Rig

if TYPE_CHECKING:
    from sautereau.daq.source.answers import Answers


class Acquisition:
    """An acquisition of all channels of a rig's ``daq``.

    Use it as a context manager: entering builds the task and reserves the device, `start` arms
    it, `blocks` reads it, and leaving clears it, also after an error. Without `start` it is a dry
    run: `settings` returns what the device has accepted.
    """

    def __init__(self, daq: Daq, duration_s: float | None, *, triggered: bool = True):
        """Prepare; the device is accessed on entering the context.

        Args:
            duration_s: Duration after the trigger's edge or the start, s; rounded up to an
                integer number of samples, at least the 2 that the driver requires; None to
                continue until the context is left.
            triggered: Whether the trigger's edge starts it, with ``daq.pre_trigger`` recorded
                before the edge; if not, `start` starts it.

        Raises:
            DaqError: The settings are impossible for any device.
        """
        self._daq = daq
        self._plan = plan_task(daq, duration_s, triggered)
        self.n_samples = self._plan.total
        """Number of samples of each channel, those before the edge included; None if endless."""
        self.rate = daq.sample_rate
        """Actual sampling rate of every channel, Hz; known after entering."""
        self.scaling: Scaling | None = None
        """What the counts of the device are; None if it gives volts. Known after entering."""
        self.device_description = ""
        """Product type, serial number and name of the device; empty before entering."""
        self._stack = ExitStack()
        self._options: Any = None
        self._answers: Answers | None = None
        self._task: Any = None
        self._counter: SampleCounter
        self._simulated: bool | None = None
        self._trigger = ""
        self._inputs: tuple[InputSettings, ...] = ()

    @property
    def simulated(self) -> bool:
        """Whether the device itself reports that it is simulated."""
        if self._simulated is None:
            raise DaqError("acquisition: not entered yet; read `simulated` inside `with`")
        return self._simulated

    def of_device(self, rig: Rig) -> Rig:
        """Return a rig whose channels have the delays that the device reports.

        A recording is written with it, so that its delays are those of the device it came from.
        """
        channels = tuple(
            channel.model_copy(update={"input_delay": actual.delay})
            for channel, actual in zip(rig.daq.channels, self._inputs, strict=True)
        )
        return rig.replaced({"daq.channels": channels})

    def __enter__(self) -> "Acquisition":
        from nidaqmx.constants import TaskMode

        daq, plan = self._daq, self._plan
        try:
            connection = connect(daq, self._longest_wait)
            self._options, self._answers = self._stack.enter_context(connection)
            with driver_errors(daq, "setting up the task", self._options):
                if plan.triggered:
                    self._trigger = trigger_terminal(daq, self._options)
                self._task = create_task(daq, self._options, self._stack)
                self._counter = SampleCounter(self._task, plan)
                for channel in daq.channels:
                    adding = f"setting up daq.channels.{channel.name}"
                    with driver_errors(daq, adding, self._options):
                        add_input(self._task, daq, channel)
                self.rate = build_task(self._task, plan, self._trigger)
                self._task.control(TaskMode.TASK_VERIFY)
                self._inputs = read_inputs(self._task, daq)
                self.scaling = read_scaling(self._task, self._inputs)
                self._task.control(TaskMode.TASK_RESERVE)
            with driver_errors(self._daq, "identifying the device", self._options):
                devices = list(self._task.devices)
                self._simulated = any(bool(device.is_simulated) for device in devices)
                self.device_description = "; ".join(
                    f"{one.product_type}, serial number {one.serial_num:08X}, {one.name}"
                    for one in devices
                )
        except BaseException as error:
            self.__exit__(type(error), error, None)
            raise
        return self

    def __exit__(self, _type: object, first: BaseException | None, _trace: object) -> None:
        """Clear the task and the connection; an error here never replaces ``first``."""
        task, self._task = self._task, None
        try:
            with self._stack:
                if task is not None:
                    with driver_errors(self._daq, "clearing the task", self._options):
                        task.close()
        except DaqError as error:
            if first is None:
                raise
            first.add_note(f"then clearing the task failed as well: {error}")

    def settings(self) -> SourceSettings:
        """Return the task as the device has accepted and verified it."""
        plan = self._plan
        with driver_errors(self._daq, "reading its buffer", self._options):
            buffer = self._entered().in_stream.input_buf_size
        return SourceSettings(
            device=self.device_description,
            simulated=self.simulated,
            channels=self._inputs,
            requested_rate=self._daq.sample_rate,
            rate=self.rate,
            n_samples=plan.total,
            pre_trigger_samples=plan.before,
            buffer=buffer,
            block=self._daq.block,
            trigger=self._trigger,
        )

    def start(self) -> None:
        """Arm: the trigger's edge starts the acquisition; without a trigger it starts now.

        Returns when enough samples before the edge have been acquired.
        """
        with driver_errors(self._daq, "arming", self._options):
            self._entered()
            self._counter.start()
            if self._plan.before:
                self._counter.await_pre_trigger()

    def stop(self) -> None:
        """End the acquisition, complete or not."""
        with driver_errors(self._daq, "stopping", self._options):
            self._entered().stop()

    def blocks(self) -> Iterator[Block]:
        """Yield the samples in blocks of ``daq.block``; of a finite acquisition all of them.

        With samples before the trigger's edge the first block has a negative index, and the
        device returns samples only after the last one. The part of a block that was read before
        an error is yielded before the error is raised.

        Raises:
            DaqError: The trigger or a later block did not arrive within
                ``daq.trigger_timeout``, samples were lost, or the device was disconnected.
        """
        daq, plan = self._daq, self._plan
        kind, read = self._reader()
        position = 0
        doing = "waiting for the trigger" if plan.before else "reading"
        with driver_errors(daq, doing, self._options):
            if plan.before:
                counts = self._counter.await_all(self._longest_wait)
            else:
                counts = self._counter.await_first()
        if plan.before and not counts:
            raise self._no_edge()
        while plan.total is None or position < plan.total:
            n = daq.block if plan.total is None else min(daq.block, plan.total - position)
            # A driver that fills it less than it says leaves what no recording accepts.
            samples = np.full((len(daq.channels), n), np.nan if kind == "float64" else 0, kind)
            with driver_errors(daq, "reading", self._options):
                count, fault = self._read(read, samples)
                if not plan.before and fault is None and position < DATING * self.rate:
                    dated, fault = self._counted()
                    counts += dated
            block = Block(position - plan.before, samples[:, :count], counts, self.scaling)
            block, odd = block.finite([channel.name for channel in daq.channels])
            if odd:
                fault = DaqError(f"DAQ device {daq.device}: {odd}: check it, and press again")
            if block.n_samples:
                yield block
            counts = ()
            position += block.n_samples
            if fault is not None:
                if getattr(fault, "error_code", None) == NOT_YET_AVAILABLE:
                    raise self._too_late(position, n) from fault
                with driver_errors(daq, "reading", self._options):
                    raise fault
            if plan.total is None:
                self._check_position(position)

    def _counted(self) -> tuple[tuple[Counted, ...], Exception | None]:
        """Return a dated count of samples, or why there is none: what was read is kept first."""
        try:
            return (self._counter.count(),), None
        except Exception as error:  # noqa: BLE001 - raised by `blocks` after that block
            return (), error

    def _reader(self) -> tuple[str, Callable[..., int]]:
        """Return the type of the samples, and the function that reads them into an array."""
        from nidaqmx.stream_readers import AnalogMultiChannelReader, AnalogUnscaledReader

        stream = self._entered().in_stream
        scaling = self.scaling
        if scaling is None:
            reader = AnalogMultiChannelReader(stream)
            reader.verify_array_shape = False
            return "float64", reader.read_many_sample
        unscaled = AnalogUnscaledReader(stream)
        unscaled.verify_array_shape = False
        return scaling.kind, getattr(unscaled, f"read_{scaling.kind}")

    def _read(
        self, read: Callable[..., int], samples: NDArray[Any]
    ) -> tuple[int, Exception | None]:
        """Fill ``samples``; return how many of each channel have arrived, and why not all."""
        from nidaqmx.errors import DaqReadError

        (k, n), fault, answers = samples.shape, None, self._answers
        try:
            count = read(samples, n, timeout=self._daq.trigger_timeout)
        except DaqReadError as error:
            count, fault = error.samps_per_chan_read, error
        except AssertionError:  # of the client's library: more numbers than requested
            if answers is None or answers.numbers <= samples.size:
                raise
            count = answers.said
        numbers = samples.size if answers is None else answers.numbers
        if fault is not None and numbers == count == 0:
            return 0, fault
        # With another number of numbers it is unknown which of them are whose.
        # The driver returns fewer samples with an error only: of another answer it is unknown, too.
        least, most = (0, n) if fault is not None else (n, n)
        if numbers not in (samples.size, k * count) or not least <= count <= most:
            code = "" if fault is None else f" with error {fault.error_code}"
            return 0, DaqError(
                f"DAQ device {self._daq.device}: an answer{code} to a read of {n} samples of {k}"
                f" channels says that {count} of each were read, and has {numbers} numbers instead"
                f" of {samples.size}; none of them is recorded: update NI's gRPC device server and"
                " its driver, and press again"
            )
        if answers is not None and answers.beyond is not None:
            return 0, DaqError(
                f"DAQ device {self._daq.device}: an answer to a read has the count"
                f" {answers.beyond}, beyond {samples.dtype}; none of it is recorded: update NI's"
                " gRPC device server and its driver, and press again"
            )
        if count < n:
            # The driver puts the channels of a partial read together at the beginning.
            samples[:, :count] = samples.ravel()[: k * count].reshape(k, count).copy()
        return count, fault

    def _too_late(self, count: int, n: int) -> DaqError:
        daq = self._daq
        if count == 0 and self._plan.triggered:
            return self._no_edge()
        of_all = "" if self._plan.total is None else f" of {self._plan.total}"
        return DaqError(
            f"DAQ device {daq.device}: the samples stopped at {count}{of_all}:"
            f" no complete block within {daq.trigger_timeout:g} s; raise daq.trigger_timeout"
            f" above the {n / self.rate:.3g} s of a block, or check whether the device is"
            " still plugged in"
        )

    def _no_edge(self) -> DaqError:
        daq = self._daq
        return DaqError(
            f"DAQ device {daq.device}: no edge on {self._trigger}"
            f" within {daq.trigger_timeout:g} s; check that a cable connects the controller's"
            " output controller.trigger_output to that terminal, that the controller has started"
            " the press, and that daq.trigger_source names the terminal"
        )

    def _check_position(self, position: int) -> None:
        """Refuse to continue if the driver has skipped samples."""
        with driver_errors(self._daq, "reading", self._options):
            actual = self._entered().in_stream.curr_read_pos
        if actual != position:
            raise DaqError(
                f"DAQ device {self._daq.device}: {actual - position} samples were lost before"
                f" sample {actual}; free the machine, or lower daq.sample_rate, and record again"
            )

    @property
    def _longest_wait(self) -> float:
        """Longest time for which a call may wait for samples, s."""
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
