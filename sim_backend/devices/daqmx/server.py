"""Serve a simulated card as NI's gRPC device server would, on loopback.

The servicer derives from the one that ships in nidaqmx, so that the real client runs
unmodified. Calls that are not implemented answer UNIMPLEMENTED by the base class. A failing call
answers as the real server: a status, with the driver's code in the trailing metadata ``ni-error``.
"""

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from datetime import datetime
from typing import Any

import grpc
from nidaqmx._stubs import nidaqmx_pb2_grpc
from session_pb2 import Session

from sautereau.rig.disk import need_open_files
from sautereau.sim_backend.devices.daqmx.attributes import Table, call, calls, given, number
from sautereau.sim_backend.devices.daqmx.card import Card, DaqmxError, module_of, physical_channels
from sautereau.sim_backend.devices.daqmx.creation import CREATING, SCALE, Scale, find_scale
from sautereau.sim_backend.devices.daqmx.progress import CardTask
from sautereau.sim_backend.devices.daqmx.properties import (
    CALIBRATION,
    CHANNEL,
    DEVICE,
    EXPORTED,
    PHYSICAL_CHANNEL,
    SYSTEM,
    TASK,
    Calibration,
    Device,
    Seat,
)
from sautereau.sim_backend.devices.daqmx.reading import BUFFER, READ, Reading
from sautereau.sim_backend.devices.daqmx.task_events import Events
from sautereau.sim_backend.devices.daqmx.timing import CONFIGURING, TIMING, TRIGGER, conversion_rate

_INITIALIZE, _ATTACH = 1, 2
_START, _STOP, _VERIFY, _COMMIT, _RESERVE, _UNRESERVE, _ABORT = range(7)
_OPTIONS = (("grpc.so_reuseport", 0), ("grpc.max_send_message_length", -1))
_WORKERS = 32  # Calls that are answered at the same time; further ones are refused at once


class Servicer(Reading, Events, nidaqmx_pb2_grpc.NiDAQmxServicer):
    """The complete stand-in; each method is the call of nidaqmx.proto of that name.

    Calls about properties, and those that configure, are added from their tables.
    """

    def __init__(self, card: Card):
        self._card = card
        self.scales: dict[str, Scale] = {}
        """Custom scales by name."""
        self._tasks: dict[str, CardTask] = {}
        self._lock = threading.Lock()
        self._gone = False
        self._closing = threading.Event()
        self._started = datetime.now()
        self._calibrations: dict[str, Calibration] = {}
        self._count = 0

    def stop_all(self) -> None:
        """End every run, so that no call waits any longer."""
        self._closing.set()
        with self._lock:
            for task in self._tasks.values():
                task.stop()

    # What a request is about

    def _device(self, request: Any) -> Device:
        """Return the device or chassis that the request names, if it is connected."""
        for module in self._card.modules:
            if module.chassis and request.device_name.lower() == module.chassis.lower():
                self._card.check()
                return Device(self._card, module, is_chassis=True)
        return Device(self._card, module_of(self._card, request.device_name))

    def _calibration(self, request: Any) -> Calibration:
        """Return the calibration of the device that the request names."""
        if (one := self._device(request)).is_chassis:
            raise DaqmxError(-200197, "The chassis has no converter to calibrate.")
        started = self._started
        return self._calibrations.setdefault(one.module.name, Calibration(started, started))

    def _physical(self, request: Any) -> Device:
        return Device(self._card, physical_channels(request.physical_channel, self._card)[0][0])

    def _task(self, request: Any) -> CardTask:
        task = self._tasks.get(request.task.name)
        if task is None:
            raise DaqmxError(-200088, "Task specified is invalid or does not exist.")
        return task

    def _seats(self, request: Any) -> list[Seat]:
        """Return the channels that a request names; all where it names none."""
        task = self._task(request)
        seats = [Seat(task, name) for name in task.named(request.channel)]
        if not seats:
            raise DaqmxError(-200478, "There are no channels in the task.")
        return seats

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
        return {"task": Session(name=name), "new_session_initialized": not exists}

    # Running it

    @contextmanager
    def _holding(self, task: CardTask) -> Iterator[None]:
        """Hold the card for a task, which no other may have reserved."""
        with self._lock:
            for other in self._tasks.values():
                if other is not task and (other.reserved or other.run is not None):
                    raise DaqmxError(-50103, f"The resource is reserved by task {other.name}.")
            yield

    @call
    def StartTask(self, request, context):  # noqa: N802
        task = self._task(request)
        with self._holding(task):
            task.start()

    @call
    def StopTask(self, request, context):  # noqa: N802
        task = self._task(request)
        task.stop()
        if task.log_fault is not None:
            raise task.log_fault

    @call
    def ClearTask(self, request, context):  # noqa: N802
        task = self._task(request)
        with self._lock:
            self._tasks.pop(task.name, None)
        task.stop()

    @call
    def TaskControl(self, request, context):  # noqa: N802
        task = self._task(request)
        action = given(request, "action")
        if action == _START:
            with self._holding(task):
                task.start()
        elif action in (_STOP, _UNRESERVE, _ABORT):
            task.stop()
            task.reserved = task.reserved and action == _STOP
        elif action == _VERIFY:
            task.verify()
        elif action in (_COMMIT, _RESERVE):
            task.verify()
            with self._holding(task):
                task.reserved = True
        else:
            raise DaqmxError(-200077, f"Task action {action} does not exist.")

    @call
    def IsTaskDone(self, request, context):  # noqa: N802
        return {"is_task_done": self._task(request).done}

    @call
    def WaitUntilTaskDone(self, request, context):  # noqa: N802
        task = self._task(request)
        if task.run is not None:
            there = task.wait(task.length, request.time_to_wait, context.is_active)
            if there < task.length:
                raise DaqmxError(
                    -200560, "Wait Until Done did not indicate that the task was done in time."
                )

    # Errors, and the device itself

    @call
    def GetErrorString(self, request, context):  # noqa: N802
        from nidaqmx.error_codes import DAQmxErrors  # slow

        try:
            text = DAQmxErrors(request.error_code).name.replace("_", " ").capitalize() + "."
        except ValueError:
            text = "Error code could not be found."
        return {"error_string": text}

    @call
    def GetNthTaskDevice(self, request, context):  # noqa: N802
        task = self._task(request)
        if not task.channels or not 1 <= request.index <= len(task.modules):
            raise DaqmxError(-200077, f"The task has no device number {request.index}.")
        return {"buffer": task.modules[request.index - 1].name}

    @call
    def ResetDevice(self, request, context):  # noqa: N802
        self._device(request)
        with self._lock:
            for task in self._tasks.values():
                task.stop()
                task.reserved = False

    @call
    def DeviceSupportsCal(self, request, context):  # noqa: N802
        self._device(request)
        return {"cal_supported": True}

    @call
    def SelfCal(self, request, context):  # noqa: N802
        self._calibration(request).own = datetime.now()

    @call
    def GetSelfCalLastDateAndTime(self, request, context):  # noqa: N802
        return _date(self._calibration(request).own)

    @call
    def GetExtCalLastDateAndTime(self, request, context):  # noqa: N802
        return _date(self._calibration(request).external)


def _date(date: datetime) -> dict[str, int]:
    return {part: getattr(date, part) for part in ("year", "month", "day", "hour", "minute")}


def _only_connected(self: Servicer, request: Any, context: Any) -> None:
    self._device(request)  # its converter does not drift


def _no_device_context(self: Servicer, request: Any, context: Any) -> Any:
    raise DaqmxError(-201118, "This operation does not support a device context.")


def _convert_clock(self: Servicer, request: Any, context: Any) -> Any:
    """Return the one property that modules of a task have each for itself."""
    if given(request, "attribute") != number("TIMING", "AI_CONV_RATE"):
        raise _no_device_context(self, request, context)
    module = module_of(self._card, request.device_names)
    return {"value": conversion_rate(self._task(request), module)}


PROPERTIES: dict[str, tuple[Callable[[Any, Any], Any], Table]] = {
    "SystemInfo": (lambda self, request: self._card, SYSTEM),
    "Device": (Servicer._device, DEVICE),
    "PhysicalChan": (Servicer._physical, PHYSICAL_CHANNEL),
    "Task": (Servicer._task, TASK),
    "Chan": (Servicer._seats, CHANNEL),
    "Timing": (Servicer._task, TIMING),
    "Trig": (Servicer._task, TRIGGER),
    "Read": (Servicer._task, READ),
    "Buffer": (Servicer._task, BUFFER),
    "ExportedSignal": (Servicer._task, EXPORTED),
    "CalInfo": (Servicer._calibration, CALIBRATION),
    "Scale": (lambda self, request: find_scale(self, request.scale_name), SCALE),
}
"""What a request is about, and the properties of that, by the subject in the names of the calls."""

for _subject, (_find, _table) in PROPERTIES.items():
    for _name, _method in calls(_subject, _find, _table).items():
        setattr(Servicer, _name, _method)
for _name, _method in {**CREATING, **CONFIGURING}.items():
    setattr(Servicer, _name, _method)
for _name in ("SelfTestDevice", "RestoreLastExtCalConst"):
    setattr(Servicer, _name, call(_only_connected, _name))
for _name in dir(nidaqmx_pb2_grpc.NiDAQmxServicer):
    if "TimingAttributeEx" in _name:
        _of_module = _convert_clock if _name == "GetTimingAttributeExDouble" else _no_device_context
        setattr(Servicer, _name, call(_of_module, _name))


class DaqmxServer:
    """A server for one card; a context manager that serves while it is entered, once."""

    def __init__(self, card: Card):
        self.address = ""
        """``127.0.0.1:port``, the port chosen by the operating system; empty when not served."""
        need_open_files()
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
