"""A fake NI gRPC device server: one device, a ramp that is known, and one fault at one call.

The real nidaqmx client speaks to it. It shares no code with the project, neither with its
acquisition nor with its stand-in.
"""

import math
import threading
import time
from collections import Counter
from collections.abc import Callable
from concurrent import futures
from dataclasses import dataclass, field
from typing import Any

import grpc
from nidaqmx._stubs import nidaqmx_pb2 as messages
from nidaqmx._stubs import nidaqmx_pb2_grpc
from session_pb2 import Session

STEP = 3.2e-4  # V, of a count, and from one sample to the next
OFFSET = 10_000  # Counts from one channel to the next
EDGE = 0.02  # s, from the start of a triggered task to the trigger's edge
TIMEOUT = -200284
LIBRARY = {
    TIMEOUT: "Some or all of the samples requested have not yet been acquired.",
    -200279: "The application is not able to keep up with the hardware acquisition.",
    -201003: "Device cannot be accessed.",
}
"""Texts of codes as the driver gives them; the others have none here."""


@dataclass(frozen=True)
class Call:
    """One call of a client: its method with the attribute, and its number among those."""

    name: str
    number: int = 1

    def __str__(self) -> str:
        return f"{self.name}#{self.number}"


class Coded(Exception):  # noqa: N818
    """An error of the driver, as the server reports it in trailing metadata."""

    def __init__(self, code: int, text: str | None = None, n_read: int | None = None):
        self.code, self.n_read = code, n_read
        self.text = LIBRARY.get(code, "") if text is None else text


def refuse(context: grpc.ServicerContext, error: Coded) -> None:
    """End a call as NI's server ends it for an error of the driver."""
    metadata = [("ni-error", str(error.code))]
    if error.n_read is not None:
        metadata.append(("ni-samps-per-chan-read", str(error.n_read)))
    context.set_trailing_metadata(metadata)
    context.abort(grpc.StatusCode.UNKNOWN, error.text)


@dataclass
class Task:
    """One task: its channels, what was set, and how many samples were read."""

    channels: dict[str, str] = field(default_factory=dict)
    values: dict[str, Any] = field(default_factory=dict)
    rate: float = 1000.0
    size: int = 1000
    finite: bool = False
    triggered: bool = False
    pre_trigger: int = 0
    started: float | None = None
    read: int = 0

    def acquired(self) -> int:
        """Return the number of samples of each channel up to now."""
        if self.started is None:
            return 0
        n = int((time.monotonic() - self.started - EDGE * self.triggered) * self.rate)
        return max(0, min(n, self.last()))

    def last(self) -> float:
        """Return how many it acquires; with samples before the edge, all from the start on."""
        if not self.finite:
            return math.inf
        if not self.pre_trigger:
            return self.size
        return max(int(EDGE * self.rate), self.pre_trigger) + self.size - self.pre_trigger

    def readable(self) -> int:
        """Return how many of them the client can read; with samples before an edge, at the end."""
        n = self.acquired()
        return n if not self.pre_trigger else self.size if n == self.last() else 0

    def counts(self, first: int, stop: int) -> list[int]:
        """Return samples of the ramp, those of one channel after those of another."""
        return [k + OFFSET * c for c in range(len(self.channels)) for k in range(first, stop)]


def short_name(request: Any) -> str:
    """Return the attribute that a request names: `AI_MAX`; empty for a method without one."""
    if "attribute_raw" not in request.DESCRIPTOR.fields_by_name:
        return ""
    number = request.attribute_raw or request.attribute
    known = request.DESCRIPTOR.fields_by_name["attribute"].enum_type.values_by_number
    return known[number].name.partition("ATTRIBUTE_")[2] if number in known else str(number)


class FakeCard(nidaqmx_pb2_grpc.NiDAQmxServicer):
    """A device `Dev1` with inputs of +-10 V and 16 bits, whose samples are the ramp."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all tasks, and have its own values again."""
        self.tasks: dict[str, Task] = {}
        self.values: dict[str, Any] = {
            "NIDAQ_MAJOR_VERSION": 24,
            "NIDAQ_MINOR_VERSION": 3,
            "NIDAQ_UPDATE_VERSION": 0,
            "DEVICES": "Dev1",
            "NUM_DEVICES": 1,
            "DEV_NAMES": "Dev1",
            "PRODUCT_TYPE": "USB-6211",
            "PRODUCT_CATEGORY": messages.DEVICE_INT32_PRODUCT_CATEGORY_M_SERIES_DAQ,
            "SERIAL_NUM": 0x1234567,
            "IS_SIMULATED": False,
            "AI_SIMULTANEOUS_SAMPLING_SUPPORTED": False,
            "AI_CONV_RATE": 100e3,
            "CHAN_TYPE": messages.CHANNEL_INT32_CHANNEL_TYPE_AI,
            "AI_MEAS_TYPE": messages.CHANNEL_INT32_AI_MEASUREMENT_TYPE_VOLTAGE,
            "AI_RNG_LOW": -10.0,
            "AI_RNG_HIGH": 10.0,
            "AI_TERM_CFG": messages.CHANNEL_INT32_INPUT_TERM_CFG_DIFF,
            "AI_COUPLING": messages.CHANNEL_INT32_COUPLING1_DC,
            "AI_RAW_SAMP_SIZE": 16,
            "AI_RESOLUTION": 16.0,
            "AI_RAW_SAMP_JUSTIFICATION": messages.CHANNEL_INT32_DATA_JUSTIFICATION1_RIGHT_JUSTIFIED,
            "AI_DEV_SCALING_COEFF": [0.0, STEP, 0.0, 0.0],
        }

    # Tasks

    def CreateTask(self, request, context):  # noqa: N802
        if request.session_name in self.tasks:
            raise Coded(-200089, "Task name conflicts with an existing task name.")
        self.tasks[request.session_name] = Task(values={"NAME": request.session_name})
        task = Session(name=request.session_name)
        return messages.CreateTaskResponse(task=task, new_session_initialized=True)

    def ClearTask(self, request, context):  # noqa: N802
        self.tasks.pop(request.task.name, None)
        return messages.ClearTaskResponse()

    def CreateAIVoltageChan(self, request, context):  # noqa: N802
        task = self.task(request)
        name = request.name_to_assign_to_channel or request.physical_channel
        task.channels[name] = request.physical_channel
        task.values |= {"AI_MIN": request.min_val, "AI_MAX": request.max_val}
        return messages.CreateAIVoltageChanResponse()

    def CfgSampClkTiming(self, request, context):  # noqa: N802
        task = self.task(request)
        task.rate, task.size = request.rate, request.samps_per_chan
        task.finite = request.sample_mode_raw == messages.ACQUISITION_TYPE_FINITE_SAMPS
        task.values["SAMP_CLK_RATE"] = request.rate
        return messages.CfgSampClkTimingResponse()

    def CfgDigEdgeStartTrig(self, request, context):  # noqa: N802
        self.task(request).triggered = True
        return messages.CfgDigEdgeStartTrigResponse()

    def CfgDigEdgeRefTrig(self, request, context):  # noqa: N802
        task = self.task(request)
        task.pre_trigger = request.pretrigger_samples
        return messages.CfgDigEdgeRefTrigResponse()

    def GetErrorString(self, request, context):  # noqa: N802
        return messages.GetErrorStringResponse(error_string=LIBRARY.get(request.error_code, ""))

    def TaskControl(self, request, context):  # noqa: N802
        self.task(request)
        return messages.TaskControlResponse()

    def StartTask(self, request, context):  # noqa: N802
        self.task(request).started = time.monotonic()
        return messages.StartTaskResponse()

    def StopTask(self, request, context):  # noqa: N802
        self.task(request).started = None
        return messages.StopTaskResponse()

    def WaitUntilTaskDone(self, request, context):  # noqa: N802
        task, until = self.task(request), time.monotonic() + request.time_to_wait
        while task.acquired() < task.last():
            if not until - time.monotonic() >= 0:
                raise Coded(-200560, "Wait Until Done did not indicate that the task was done.")
            time.sleep(1e-3)
        return messages.WaitUntilTaskDoneResponse()

    # Samples

    def ReadAnalogF64(self, request, context):  # noqa: N802
        counts, n, status = self.read(request)
        volts = [STEP * count for count in counts]
        return messages.ReadAnalogF64Response(
            status=status, read_array=volts, samps_per_chan_read=n
        )

    def ReadBinaryI16(self, request, context):  # noqa: N802
        counts, n, status = self.read(request)
        return messages.ReadBinaryI16Response(
            status=status, read_array=counts, samps_per_chan_read=n
        )

    def read(self, request: Any) -> tuple[list[int], int, int]:
        """Return what a read gives: counts by channel, their number of each, the status.

        After a timeout the driver has put the samples of all channels together at the start of
        the array (ni/nidaqmx-python#528), and the server sends all of it.
        """
        task, until = self.task(request), time.monotonic() + request.timeout
        if task.started is None:
            raise Coded(-200278, "Attempted to read a sample beyond the final sample acquired.")
        n = request.num_samps_per_chan
        while task.readable() - task.read < n and time.monotonic() < until:
            time.sleep(1e-3)
        there = min(n, task.readable() - task.read)
        assert request.fill_mode_raw == messages.GROUP_BY_GROUP_BY_CHANNEL
        samples = task.counts(task.read, task.read + there)
        task.read += there
        if there == n:
            return samples, n, 0
        rest = request.array_size_in_samps - len(samples)
        return [*samples, *([0] * rest)], there, TIMEOUT

    def task(self, request: Any) -> Task:
        """Return the task of a request."""
        if request.task.name not in self.tasks:
            raise Coded(-200088, "Task specified is invalid or does not exist.")
        return self.tasks[request.task.name]

    # Attributes

    def get(self, request: Any) -> Any:
        """Return an attribute's value."""
        name = short_name(request)
        if name == "TOTAL_SAMP_PER_CHAN_ACQUIRED":
            return self.task(request).acquired()
        if name == "PHYSICAL_CHAN_NAME":
            return self.task(request).channels[request.channel]
        if name == "CURR_READ_POS":
            return self.task(request).read
        task = self.tasks.get(request.task.name) if hasattr(request, "task") else None
        for values in (task.values if task else {}, self.values):
            if name in values:
                return values[name]
        raise Coded(-200452, "Specified property is not supported by the device.")

    def set(self, request: Any) -> None:
        """Set an attribute of a task."""
        self.task(request).values[short_name(request)] = request.value


def _attribute_methods() -> None:
    """Add all methods that get and set attributes to the servicer."""
    for name in vars(nidaqmx_pb2_grpc.NiDAQmxServicer):
        response = getattr(messages, f"{name}Response", None)
        if "Attribute" not in name or response is None:
            continue

        def get(self, request, context, response=response):
            raw = "value_raw" if "value_raw" in response.DESCRIPTOR.fields_by_name else "value"
            return response(**{raw: self.get(request)})

        def put(self, request, context, response=response):
            self.set(request)
            return response()

        if name.startswith("Get"):
            setattr(FakeCard, name, get)
        elif name.startswith("Set"):
            setattr(FakeCard, name, put)


_attribute_methods()


class _Interceptor(grpc.ServerInterceptor):
    """Give every call to the server, which answers it by the card or by its fault."""

    def __init__(self, server: "FakeServer"):
        self._server = server

    def intercept_service(self, continuation, handler_call_details):
        handler = continuation(handler_call_details)
        if handler is None or handler.unary_unary is None:
            return handler
        method = handler_call_details.method.rpartition("/")[2]

        def answer(request, context):
            return self._server.answer(method, request, context, handler.unary_unary)

        return grpc.unary_unary_rpc_method_handler(
            answer, handler.request_deserializer, handler.response_serializer
        )


Act = Callable[["FakeServer", Any, Any, Callable[[], Any]], Any]
"""Takes the server, the context, the request and what makes the right answer; gives another."""


class FakeServer:
    """The server on 127.0.0.1, a context manager. `set` makes it new, with one fault."""

    def __init__(self) -> None:
        self.card = FakeCard()
        self._lock = threading.Lock()
        self.set()

    def set(self, call: Call | None = None, act: Act | None = None, **values: Any) -> None:
        """Forget everything, and answer one call otherwise.

        Args:
            call: The call; its number 0 means every one of that name.
            act: What answers it.
            values: Values of attributes that the device has instead of its own.
        """
        self.released = threading.Event()
        self.card.reset()
        self.card.values |= values
        self.calls: list[Call] = []
        self.delivered = 0
        self.edge = self.first_read = math.nan
        """Dates of the first sample, at the earliest, and of its answer, s since 1970."""
        self.at_fault: int | None = None
        self._fault, self._act = call, act
        self._counts: Counter[str] = Counter()

    @property
    def before_fault(self) -> int:
        """Number of samples of each channel that were answered rightly before the fault."""
        return self.delivered if self.at_fault is None else self.at_fault

    def __enter__(self) -> "FakeServer":
        self._server = grpc.server(
            futures.ThreadPoolExecutor(16), interceptors=[_Interceptor(self)]
        )
        nidaqmx_pb2_grpc.add_NiDAQmxServicer_to_server(self.card, self._server)
        self.address = f"127.0.0.1:{self._server.add_insecure_port('127.0.0.1:0')}"
        self._server.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.released.set()
        self._server.stop(None).wait()

    def answer(self, method: str, request: Any, context: Any, right: Callable[..., Any]) -> Any:
        """Answer a call, and record it."""
        name = f"{method} {short_name(request)}".strip()
        with self._lock:
            self._counts[name] += 1
            call = Call(name, self._counts[name])
            self.calls.append(call)
        faulty = self._fault is not None and self._fault in (call, Call(name, 0))
        if faulty and self.at_fault is None:
            self.at_fault = self.delivered

        def make() -> Any:
            before = time.time()
            answer = right(request, context)
            if method == "StartTask":
                self.edge = before + EDGE * self.card.task(request).triggered
            elif method.startswith("Read") and math.isnan(self.first_read):
                self.first_read = time.time()
            return answer

        try:
            if faulty and self._act is not None:
                return self._act(self, context, request, make)
            answer = make()
            if method.startswith("Read"):
                self.delivered += answer.samps_per_chan_read
            return answer
        except Coded as error:
            return refuse(context, error)
