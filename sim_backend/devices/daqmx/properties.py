"""The properties that the DAQmx stand-in tells: of system, device, task, read, timing, channel."""

import threading
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import grpc
from nidaqmx._stubs import nidaqmx_pb2 as pb
from nidaqmx._stubs import nidaqmx_pb2_grpc

from sautereau.sim_backend.devices.daqmx.card import Card, DaqmxError, ServerGone
from sautereau.sim_backend.devices.daqmx.task import MAX_RATE, MAX_VOLTAGE, CardTask

PRODUCT_TYPE = "sautereau stand-in"
SERIAL_NUMBER = 0x5A07E2EA
_DRIVER_VERSION = {0x1272: 25, 0x1923: 0, 0x2F22: 0}
_ANALOG_INPUT, _VOLTAGE, _UNKNOWN_PRODUCT = 10100, 10322, 12588
_GONE = "Socket closed"

Value = TypeVar("Value")
Table = dict[int, Callable[[], Value]]


def call(method: Callable[..., Any]) -> Callable[..., Any]:
    """Answer a `DaqmxError` the way the real server answers the driver's errors.

    A server that is gone answers every call as gRPC does where nobody listens.
    """

    @wraps(method)
    def answer(self: "Properties", request: Any, context: grpc.ServicerContext) -> Any:
        if self._gone:
            context.abort(grpc.StatusCode.UNAVAILABLE, _GONE)
        try:
            return method(self, request, context)
        except ServerGone:
            self._gone = True
            context.abort(grpc.StatusCode.UNAVAILABLE, _GONE)
        except DaqmxError as fault:
            trailer = [("ni-error", str(fault.code))]
            if fault.samples_read is not None:
                trailer.append(("ni-samps-per-chan-read", str(fault.samples_read)))
            context.set_trailing_metadata(tuple(trailer))
            context.abort(grpc.StatusCode.UNKNOWN, str(fault))

    return answer


def look_up(table: Table[Value], request: Any) -> Value:
    attribute = request.attribute_raw or request.attribute
    if attribute not in table:
        raise DaqmxError(-200197, f"Property {attribute:#x} is not supported by the stand-in.")
    return table[attribute]()


class Properties(nidaqmx_pb2_grpc.NiDAQmxServicer):
    """The calls that only tell; each method is the call of nidaqmx.proto of that name."""

    def __init__(self, card: Card):
        self._card = card
        self._tasks: dict[str, CardTask] = {}
        self._lock = threading.Lock()
        self._gone = False

    def _task(self, request: Any) -> CardTask:
        task = self._tasks.get(request.task.name)
        if task is None:
            raise DaqmxError(-200088, "Task specified is invalid or does not exist.")
        return task

    def _device(self, request: Any) -> tuple[str, ...]:
        """Return the inputs of the device asked about."""
        if request.device_name.lower() != self._card.name.lower():
            raise DaqmxError(
                -200220, f"Device identifier is invalid. Device: {request.device_name}"
            )
        return self._card.terminals

    # System and device

    @call
    def GetSystemInfoAttributeUInt32(self, request, context):  # noqa: N802
        table: Table[int] = {k: lambda v=v: v for k, v in _DRIVER_VERSION.items()}
        return pb.GetSystemInfoAttributeUInt32Response(value=look_up(table, request))

    @call
    def GetSystemInfoAttributeString(self, request, context):  # noqa: N802
        table: Table[str] = {
            0x193B: lambda: self._card.name,
            0x1267: lambda: "",
            0x1265: lambda: "",
            0x1266: lambda: "",
        }
        return pb.GetSystemInfoAttributeStringResponse(value=look_up(table, request))

    @call
    def GetDeviceAttributeString(self, request, context):  # noqa: N802
        terminals = self._device(request)
        inputs = ", ".join(f"{self._card.name}/{terminal}" for terminal in terminals)
        table: Table[str] = {0x631: lambda: PRODUCT_TYPE, 0x231E: lambda: inputs}
        # It has no analog outputs, digital lines, digital ports, nor counters.
        table |= {k: lambda: "" for k in (0x231F, 0x2320, 0x2321, 0x2322, 0x2323, 0x2324, 0x2325)}
        return pb.GetDeviceAttributeStringResponse(value=look_up(table, request))

    @call
    def GetDeviceAttributeUInt32(self, request, context):  # noqa: N802
        self._device(request)
        table: Table[int] = {0x632: lambda: SERIAL_NUMBER, 0x231D: lambda: 0}
        return pb.GetDeviceAttributeUInt32Response(value=look_up(table, request))

    @call
    def GetDeviceAttributeInt32(self, request, context):  # noqa: N802
        self._device(request)
        table: Table[int] = {0x29A9: lambda: _UNKNOWN_PRODUCT}
        return pb.GetDeviceAttributeInt32Response(value_raw=look_up(table, request))

    @call
    def GetDeviceAttributeBool(self, request, context):  # noqa: N802
        self._device(request)
        return pb.GetDeviceAttributeBoolResponse(value=look_up({0x22CA: lambda: True}, request))

    @call
    def GetDeviceAttributeDouble(self, request, context):  # noqa: N802
        self._device(request)
        table: Table[float] = {0x298C: lambda: MAX_RATE, 0x298D: lambda: MAX_RATE}
        return pb.GetDeviceAttributeDoubleResponse(value=look_up(table, request))

    @call
    def GetDeviceAttributeDoubleArray(self, request, context):  # noqa: N802
        self._device(request)
        table: Table[list[float]] = {0x2990: lambda: [-MAX_VOLTAGE, MAX_VOLTAGE]}
        return pb.GetDeviceAttributeDoubleArrayResponse(value=look_up(table, request))

    # Task, channel, timing, read

    @call
    def GetTaskAttributeString(self, request, context):  # noqa: N802
        task = self._task(request)
        table: Table[str] = {
            0x1276: lambda: task.name,
            0x1273: lambda: ", ".join(task.channels),
            0x230E: lambda: self._card.name if task.channels else "",
        }
        return pb.GetTaskAttributeStringResponse(value=look_up(table, request))

    @call
    def GetTaskAttributeUInt32(self, request, context):  # noqa: N802
        task = self._task(request)
        table: Table[int] = {0x2181: lambda: len(task.channels), 0x29BA: lambda: 1}
        return pb.GetTaskAttributeUInt32Response(value=look_up(table, request))

    @call
    def GetChanAttributeInt32(self, request, context):  # noqa: N802
        self._channel(request)
        table: Table[int] = {0x187F: lambda: _ANALOG_INPUT, 0x695: lambda: _VOLTAGE}
        return pb.GetChanAttributeInt32Response(value_raw=look_up(table, request))

    @call
    def GetChanAttributeString(self, request, context):  # noqa: N802
        terminals = self._channel(request)
        physical = ", ".join(f"{self._card.name}/{terminal}" for terminal in terminals)
        return pb.GetChanAttributeStringResponse(value=look_up({0x18F5: lambda: physical}, request))

    @call
    def GetChanAttributeDouble(self, request, context):  # noqa: N802
        self._channel(request)
        table: Table[float] = {0x1815: lambda: MAX_VOLTAGE, 0x1816: lambda: -MAX_VOLTAGE}
        return pb.GetChanAttributeDoubleResponse(value=look_up(table, request))

    def _channel(self, request: Any) -> list[str]:
        """Return the terminals of the channels asked about, all where none is named."""
        channels = self._task(request).channels
        names = [name.strip() for name in request.channel.split(",") if name.strip()]
        for name in names:
            if name not in channels:
                raise DaqmxError(-200428, f"Channel {name} is not in the task.")
        return [channels[name] for name in names or channels]

    @call
    def GetTimingAttributeDouble(self, request, context):  # noqa: N802
        task = self._task(request)
        table: Table[float] = {0x1344: lambda: task.rate or 0.0}
        return pb.GetTimingAttributeDoubleResponse(value=look_up(table, request))

    @call
    def GetTimingAttributeInt32(self, request, context):  # noqa: N802
        task = self._task(request)
        table: Table[int] = {0x1300: lambda: task.mode}
        return pb.GetTimingAttributeInt32Response(value_raw=look_up(table, request))

    @call
    def GetTimingAttributeUInt64(self, request, context):  # noqa: N802
        task = self._task(request)
        table: Table[int] = {0x1310: lambda: task.n_samples}
        return pb.GetTimingAttributeUInt64Response(value=look_up(table, request))

    @call
    def SetReadAttributeInt32(self, request, context):  # noqa: N802
        task = self._task(request)
        value = request.value_raw or request.value
        look_up({0x190A: lambda: task.read_from(value)}, request)
        return pb.SetReadAttributeInt32Response()

    @call
    def GetReadAttributeInt32(self, request, context):  # noqa: N802
        task = self._task(request)
        table: Table[int] = {0x190A: lambda: task.relative}
        return pb.GetReadAttributeInt32Response(value_raw=look_up(table, request))

    @call
    def GetReadAttributeString(self, request, context):  # noqa: N802
        task = self._task(request)
        table: Table[str] = {0x1823: lambda: ", ".join(task.channels)}
        return pb.GetReadAttributeStringResponse(value=look_up(table, request))

    @call
    def GetReadAttributeUInt32(self, request, context):  # noqa: N802
        task = self._task(request)
        table: Table[int] = {
            0x217B: lambda: len(task.channels),
            0x1223: task.available,
            0x31E8: task.remaining,
        }
        return pb.GetReadAttributeUInt32Response(value=look_up(table, request))

    @call
    def GetReadAttributeUInt64(self, request, context):  # noqa: N802
        task = self._task(request)
        table: Table[int] = {
            0x1221: lambda: task.position,
            0x192A: task.acquired,
        }
        return pb.GetReadAttributeUInt64Response(value=look_up(table, request))

    @call
    def GetReadAttributeBool(self, request, context):  # noqa: N802
        self._task(request)
        return pb.GetReadAttributeBoolResponse(value=look_up({0x1215: lambda: False}, request))

    @call
    def GetBufferAttributeUInt32(self, request, context):  # noqa: N802
        task = self._task(request)
        table: Table[int] = {0x186C: lambda: task.buffer_size}
        return pb.GetBufferAttributeUInt32Response(value=look_up(table, request))
