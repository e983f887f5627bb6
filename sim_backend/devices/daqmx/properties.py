"""The properties that the DAQmx stand-in reports, of system, device, task and channel."""

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
_ANALOG_INPUT, _VOLTAGE, _UNKNOWN_PRODUCT = 10100, 10322, 12588
_GONE = "Socket closed"

Entry = TypeVar("Entry")


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


def look_up(table: dict[int, Entry], request: Any) -> Entry:
    """Return the entry of the attribute that a request names."""
    attribute = request.attribute_raw or request.attribute
    if attribute not in table:
        raise DaqmxError(-200197, f"Property {attribute:#x} is not supported by the stand-in.")
    return table[attribute]


class Properties(nidaqmx_pb2_grpc.NiDAQmxServicer):
    """The calls about properties; those that only read are added from `READABLE`."""

    def __init__(self, card: Card):
        self._card = card
        self._tasks: dict[str, CardTask] = {}
        self._lock = threading.Lock()
        self._gone = False

    def _system(self, request: Any) -> Card:
        return self._card

    def _device(self, request: Any) -> Card:
        """Return the card, if the request names it and it is connected."""
        if request.device_name.lower() != self._card.name.lower():
            raise DaqmxError(
                -200220, f"Device identifier is invalid. Device: {request.device_name}"
            )
        _ = self._card.terminals
        return self._card

    def _task(self, request: Any) -> CardTask:
        task = self._tasks.get(request.task.name)
        if task is None:
            raise DaqmxError(-200088, "Task specified is invalid or does not exist.")
        return task

    def _channels(self, request: Any) -> list[str]:
        """Return the physical channels that a request names; all where it names none."""
        channels = self._task(request).channels
        names = [name.strip() for name in request.channel.split(",") if name.strip()]
        for name in names:
            if name not in channels:
                raise DaqmxError(-200428, f"Channel {name} is not in the task.")
        return [f"{self._card.name}/{channels[name]}" for name in names or channels]

    @call
    def SetReadAttributeInt32(self, request, context):  # noqa: N802
        task = self._task(request)
        look_up({0x190A: task}, request).read_from(request.value_raw or request.value)
        return pb.SetReadAttributeInt32Response()


def _inputs(card: Card) -> str:
    return ", ".join(f"{card.name}/{terminal}" for terminal in card.terminals)


def _names(task: CardTask) -> str:
    return ", ".join(task.channels)


# Analog outputs, digital lines and ports, counters: the device has none.
_ABSENT = {key: lambda card: "" for key in range(0x231F, 0x2326)}

READABLE: dict[str, tuple[Callable[[Any, Any], Any], dict[int, Callable[[Any], Any]]]] = {
    "GetSystemInfoAttributeUInt32": (
        Properties._system,
        {0x1272: lambda card: 25, 0x1923: lambda card: 0, 0x2F22: lambda card: 0},
    ),
    "GetSystemInfoAttributeString": (
        Properties._system,
        {0x193B: lambda card: card.name}
        | {key: lambda card: "" for key in (0x1267, 0x1265, 0x1266)},
    ),
    "GetDeviceAttributeString": (
        Properties._device,
        {0x631: lambda card: PRODUCT_TYPE, 0x231E: _inputs, **_ABSENT},
    ),
    "GetDeviceAttributeUInt32": (
        Properties._device,
        {0x632: lambda card: SERIAL_NUMBER, 0x231D: lambda card: 0},
    ),
    "GetDeviceAttributeInt32": (Properties._device, {0x29A9: lambda card: _UNKNOWN_PRODUCT}),
    "GetDeviceAttributeBool": (Properties._device, {0x22CA: lambda card: True}),
    "GetDeviceAttributeDouble": (
        Properties._device,
        {0x298C: lambda card: MAX_RATE, 0x298D: lambda card: MAX_RATE},
    ),
    "GetDeviceAttributeDoubleArray": (
        Properties._device,
        {0x2990: lambda card: [-MAX_VOLTAGE, MAX_VOLTAGE]},
    ),
    "GetTaskAttributeString": (
        Properties._task,
        {
            0x1276: lambda task: task.name,
            0x1273: _names,
            0x230E: lambda task: task.card.name if task.channels else "",
        },
    ),
    "GetTaskAttributeUInt32": (
        Properties._task,
        {0x2181: lambda task: len(task.channels), 0x29BA: lambda task: 1},
    ),
    "GetChanAttributeInt32": (
        Properties._channels,
        {0x187F: lambda channels: _ANALOG_INPUT, 0x695: lambda channels: _VOLTAGE},
    ),
    "GetChanAttributeString": (Properties._channels, {0x18F5: ", ".join}),
    "GetChanAttributeDouble": (
        Properties._channels,
        {0x1815: lambda channels: MAX_VOLTAGE, 0x1816: lambda channels: -MAX_VOLTAGE},
    ),
    "GetTimingAttributeDouble": (Properties._task, {0x1344: lambda task: task.rate or 0.0}),
    "GetTimingAttributeInt32": (Properties._task, {0x1300: lambda task: task.mode}),
    "GetTimingAttributeUInt64": (Properties._task, {0x1310: lambda task: task.n_samples}),
    "GetReadAttributeInt32": (Properties._task, {0x190A: lambda task: task.relative}),
    "GetReadAttributeString": (Properties._task, {0x1823: _names}),
    "GetReadAttributeUInt32": (
        Properties._task,
        {
            0x217B: lambda task: len(task.channels),
            0x1223: CardTask.available,
            0x31E8: CardTask.remaining,
        },
    ),
    "GetReadAttributeUInt64": (
        Properties._task,
        {0x1221: lambda task: task.position, 0x192A: CardTask.acquired},
    ),
    "GetReadAttributeBool": (Properties._task, {0x1215: lambda task: False}),
    "GetBufferAttributeUInt32": (Properties._task, {0x186C: lambda task: task.buffer_size}),
}
"""By the call of nidaqmx.proto: what it is about, and how its attributes are read."""


def _reader(
    name: str, subject: Callable[[Any, Any], Any], table: dict[int, Callable[[Any], Any]]
) -> Callable[..., Any]:
    response = getattr(pb, f"{name}Response")
    field = "value_raw" if name.endswith("AttributeInt32") else "value"

    def read(self: Properties, request: Any, context: grpc.ServicerContext) -> Any:
        found = subject(self, request)
        return response(**{field: look_up(table, request)(found)})

    return call(read)


for _name, (_subject, _table) in READABLE.items():
    setattr(Properties, _name, _reader(_name, _subject, _table))
