"""The calls about errors, and about the device itself."""

import threading
from collections.abc import Callable
from typing import Any

from nidaqmx._stubs import nidaqmx_pb2 as pb

from sautereau.sim_backend.devices.daqmx.attributes import call
from sautereau.sim_backend.devices.daqmx.driver_errors import DaqmxError, error_text
from sautereau.sim_backend.devices.daqmx.task import CardTask


class Utilities:
    """The part of the servicer for everything beside a task's course."""

    _device: Callable[[Any], Any]
    _task: Callable[[Any], CardTask]
    _tasks: dict[str, CardTask]
    _lock: threading.Lock

    @call
    def GetErrorString(self, request, context):  # noqa: N802
        return pb.GetErrorStringResponse(error_string=error_text(request.error_code))

    @call
    def GetNthTaskDevice(self, request, context):  # noqa: N802
        task = self._task(request)
        if request.index != 1 or not task.channels:
            raise DaqmxError(-200077, f"The task has no device number {request.index}.")
        return pb.GetNthTaskDeviceResponse(buffer=task.card.name)

    @call
    def ResetDevice(self, request, context):  # noqa: N802
        self._device(request)
        with self._lock:
            for task in self._tasks.values():
                task.progress.stop()
                task.reserved = False
        return pb.ResetDeviceResponse()

    @call
    def SelfTestDevice(self, request, context):  # noqa: N802
        self._device(request)
        return pb.SelfTestDeviceResponse()

    @call
    def DeviceSupportsCal(self, request, context):  # noqa: N802
        self._device(request)
        return pb.DeviceSupportsCalResponse(cal_supported=False)
