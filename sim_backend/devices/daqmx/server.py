"""Serve a simulated card as NI's gRPC device server would, on loopback.

The servicer derives from the one that ships in nidaqmx, so that the real client runs
unmodified. Calls that are not implemented answer UNIMPLEMENTED by the base class. A failing call
answers as the real server: a status, with the driver's code in the trailing metadata ``ni-error``.
"""

from concurrent.futures import ThreadPoolExecutor

import grpc
import numpy as np
from nidaqmx._stubs import nidaqmx_pb2 as pb
from nidaqmx._stubs import nidaqmx_pb2_grpc
from numpy.typing import NDArray
from session_pb2 import Session

from sautereau.sim_backend.devices.daqmx.card import Card, DaqmxError
from sautereau.sim_backend.devices.daqmx.properties import Properties, call, look_up
from sautereau.sim_backend.devices.daqmx.task import CardTask

_INITIALIZE, _ATTACH = 1, 2
_BY_CHANNEL, _BY_SCAN = 0, 1
_NOT_YET_AVAILABLE = -200284
_OPTIONS = (("grpc.so_reuseport", 0), ("grpc.max_send_message_length", -1))
_WORKERS = 32
"""Calls that are answered at the same time; further ones are refused at once."""
_MOST_SAMPLES = 8_000_000
"""Samples of all channels that one read may return: what a message may hold."""


class Servicer(Properties):
    """The complete stand-in; each method is the call of nidaqmx.proto of that name."""

    def __init__(self, card: Card):
        super().__init__(card)
        self._count = 0

    def stop_all(self) -> None:
        """End every run, so that no call waits any longer."""
        with self._lock:
            for task in self._tasks.values():
                task.stop()

    # Building a task

    @call
    def CreateTask(self, request, context):  # noqa: N802
        with self._lock:
            name = request.session_name or f"_unnamedTask<{self._count}>"
            exists = name in self._tasks
            if exists and request.initialization_behavior == _INITIALIZE:
                context.abort(grpc.StatusCode.ALREADY_EXISTS, f"Task {name} exists.")
            if not exists and request.initialization_behavior == _ATTACH:
                context.abort(grpc.StatusCode.FAILED_PRECONDITION, f"Task {name} does not exist.")
            if not exists:
                self._count += 1
                self._tasks[name] = CardTask(self._card, name)
        return pb.CreateTaskResponse(task=Session(name=name), new_session_initialized=not exists)

    @call
    def CreateAIVoltageChan(self, request, context):  # noqa: N802
        self._task(request).add_voltage(
            request.physical_channel,
            request.name_to_assign_to_channel,
            request.terminal_config_raw or request.terminal_config,
            request.min_val,
            request.max_val,
            request.units_raw or request.units,
        )
        return pb.CreateAIVoltageChanResponse()

    @call
    def CfgSampClkTiming(self, request, context):  # noqa: N802
        mode = request.sample_mode_raw or request.sample_mode
        self._task(request).set_clock(request.source, request.rate, mode, request.samps_per_chan)
        return pb.CfgSampClkTimingResponse()

    @call
    def CfgDigEdgeStartTrig(self, request, context):  # noqa: N802
        edge = request.trigger_edge_raw or request.trigger_edge
        self._task(request).set_trigger(request.trigger_source, edge)
        return pb.CfgDigEdgeStartTrigResponse()

    @call
    def CfgDigEdgeRefTrig(self, request, context):  # noqa: N802
        edge = request.trigger_edge_raw or request.trigger_edge
        before = request.pretrigger_samples
        self._task(request).set_trigger(request.trigger_source, edge, before)
        return pb.CfgDigEdgeRefTrigResponse()

    @call
    def DisableStartTrig(self, request, context):  # noqa: N802
        self._task(request).remove_trigger(reference=False)
        return pb.DisableStartTrigResponse()

    @call
    def DisableRefTrig(self, request, context):  # noqa: N802
        self._task(request).remove_trigger(reference=True)
        return pb.DisableRefTrigResponse()

    @call
    def SetBufferAttributeUInt32(self, request, context):  # noqa: N802
        task = self._task(request)
        look_up({0x186C: task}, request).set_buffer(request.value)
        return pb.SetBufferAttributeUInt32Response()

    # Running it

    def _reserve(self, task: CardTask) -> None:
        for other in self._tasks.values():
            if other is not task and (other.reserved or other.run is not None):
                raise DaqmxError(-50103, f"The resource is reserved by task {other.name}.")

    def _start(self, task: CardTask) -> None:
        with self._lock:
            self._reserve(task)
            task.start()

    @call
    def StartTask(self, request, context):  # noqa: N802
        self._start(self._task(request))
        return pb.StartTaskResponse()

    @call
    def StopTask(self, request, context):  # noqa: N802
        self._task(request).stop()
        return pb.StopTaskResponse()

    @call
    def ClearTask(self, request, context):  # noqa: N802
        task = self._task(request)
        with self._lock:
            self._tasks.pop(task.name, None)
        task.stop()
        return pb.ClearTaskResponse()

    @call
    def TaskControl(self, request, context):  # noqa: N802
        task = self._task(request)
        action = request.action_raw or request.action
        if action == 0:
            self._start(task)
        elif action in (1, 5, 6):
            task.stop()
            task.reserved = False
        elif action == 2:
            task.check()
        elif action in (3, 4):
            with self._lock:
                task.check()
                self._reserve(task)
                task.reserved = True
        else:
            raise DaqmxError(-200077, f"Task action {action} does not exist.")
        return pb.TaskControlResponse()

    @call
    def IsTaskDone(self, request, context):  # noqa: N802
        task = self._task(request)
        done = task.run is None or task.run.wait_for(0, 0.0) >= task.length
        return pb.IsTaskDoneResponse(is_task_done=done)

    @call
    def WaitUntilTaskDone(self, request, context):  # noqa: N802
        task = self._task(request)
        if task.run is not None:
            there = task.wait(task.length, request.time_to_wait, context.is_active)
            if there < task.length:
                raise DaqmxError(
                    -200560, "Wait Until Done did not indicate that the task was done in time."
                )
        return pb.WaitUntilTaskDoneResponse()

    # Reading

    def _read(
        self, task: CardTask, n: int, timeout: float, context: grpc.ServicerContext
    ) -> tuple[NDArray[np.float64], bool]:
        if task.run is None:
            with self._lock:
                self._reserve(task)
        try:
            return task.read(n, timeout, context.is_active)
        except DaqmxError as error:
            error.samples_read = 0
            raise

    @call
    def ReadAnalogF64(self, request, context):  # noqa: N802
        task = self._task(request)
        fill = request.fill_mode_raw or request.fill_mode
        if fill not in (_BY_CHANNEL, _BY_SCAN):
            raise DaqmxError(-200077, f"Fill mode {fill} does not exist.")
        n = request.num_samps_per_chan
        n = task.remaining() if n < 0 else n
        if n * len(task.channels) > _MOST_SAMPLES:
            raise DaqmxError(
                -50352, f"Memory for {n} samples of {len(task.channels)} channels was refused."
            )
        if request.array_size_in_samps < n * len(task.channels):
            raise DaqmxError(
                -200229,
                f"Buffer of {request.array_size_in_samps} samples is too small to hold"
                f" {n} of {len(task.channels)} channels.",
            )
        volts, complete = self._read(task, n, request.timeout, context)
        # As with the driver, a partial read keeps the layout of a complete one.
        padded = np.zeros((len(task.channels), n))
        padded[:, : volts.shape[1]] = volts
        return pb.ReadAnalogF64Response(
            status=0 if complete else _NOT_YET_AVAILABLE,
            read_array=(padded if fill == _BY_CHANNEL else padded.T).ravel().tolist(),
            samps_per_chan_read=volts.shape[1],
        )

    @call
    def ReadAnalogScalarF64(self, request, context):  # noqa: N802
        task = self._task(request)
        if len(task.channels) != 1:
            raise DaqmxError(-200428, "A scalar read needs a task of one channel.")
        volts, complete = self._read(task, 1, request.timeout, context)
        if not complete:
            raise DaqmxError(_NOT_YET_AVAILABLE, "The sample has not yet been acquired.")
        return pb.ReadAnalogScalarF64Response(value=volts[0, 0])


class DaqmxServer:
    """A server for one card; a context manager that serves while it is entered, once."""

    def __init__(self, card: Card):
        self.address = ""
        """``127.0.0.1:port``, the port chosen by the operating system; empty when not served."""
        self._servicer = Servicer(card)  # pyright: ignore[reportAbstractUsage]
        self._workers = ThreadPoolExecutor(_WORKERS, thread_name_prefix="daqmx stand-in")
        self._server = grpc.server(
            self._workers, options=_OPTIONS, maximum_concurrent_rpcs=_WORKERS
        )
        nidaqmx_pb2_grpc.add_NiDAQmxServicer_to_server(self._servicer, self._server)

    def __enter__(self) -> "DaqmxServer":
        port = self._server.add_insecure_port("127.0.0.1:0")
        self._server.start()
        self.address = f"127.0.0.1:{port}"
        return self

    def __exit__(self, *_: object) -> None:
        self.address = ""
        self._servicer.stop_all()
        self._server.stop(grace=0).wait()
        self._workers.shutdown(wait=True)
