"""The calls that configure timing, triggers and buffer of a task."""

from collections.abc import Callable
from typing import Any

from nidaqmx._stubs import nidaqmx_pb2 as pb

from sautereau.sim_backend.devices.daqmx.attributes import call, number
from sautereau.sim_backend.devices.daqmx.driver_errors import DaqmxError
from sautereau.sim_backend.devices.daqmx.task import CardTask
from sautereau.sim_backend.devices.daqmx.triggers import (
    ANALOG_EDGE,
    ANALOG_WINDOW,
    DIGITAL_EDGE,
    RISING,
)


def _keep_window(task: CardTask, word: str, request: Any) -> None:
    for name, value in (
        ("TOP", request.window_top),
        ("BTM", request.window_bottom),
        ("WHEN", request.trigger_when_raw or request.trigger_when),
    ):
        task.stored[number("TRIGGER", f"ANLG_WIN_{word}_TRIG_{name}")] = value


class Configuring:
    """The part of the servicer that configures."""

    _task: Callable[[Any], CardTask]

    @call
    def CfgSampClkTiming(self, request, context):  # noqa: N802
        self._task(request).set_clock(
            request.source,
            request.rate,
            request.active_edge_raw or request.active_edge,
            request.sample_mode_raw or request.sample_mode,
            request.samps_per_chan,
        )
        return pb.CfgSampClkTimingResponse()

    @call
    def CfgDigEdgeStartTrig(self, request, context):  # noqa: N802
        task = self._task(request)
        edge = request.trigger_edge_raw or request.trigger_edge
        task.set_trigger(task.start_trigger, DIGITAL_EDGE, request.trigger_source, edge)
        return pb.CfgDigEdgeStartTrigResponse()

    @call
    def CfgDigEdgeRefTrig(self, request, context):  # noqa: N802
        task = self._task(request)
        edge = request.trigger_edge_raw or request.trigger_edge
        source, before = request.trigger_source, request.pretrigger_samples
        task.set_trigger(task.reference, DIGITAL_EDGE, source, edge, before)
        return pb.CfgDigEdgeRefTrigResponse()

    @call
    def CfgAnlgEdgeStartTrig(self, request, context):  # noqa: N802
        task = self._task(request)
        slope = request.trigger_slope_raw or request.trigger_slope
        task.set_trigger(task.start_trigger, ANALOG_EDGE, request.trigger_source, slope)
        task.stored[number("TRIGGER", "ANLG_EDGE_START_TRIG_LVL")] = request.trigger_level
        return pb.CfgAnlgEdgeStartTrigResponse()

    @call
    def CfgAnlgEdgeRefTrig(self, request, context):  # noqa: N802
        task = self._task(request)
        slope = request.trigger_slope_raw or request.trigger_slope
        source, before = request.trigger_source, request.pretrigger_samples
        task.set_trigger(task.reference, ANALOG_EDGE, source, slope, before)
        task.stored[number("TRIGGER", "ANLG_EDGE_REF_TRIG_LVL")] = request.trigger_level
        return pb.CfgAnlgEdgeRefTrigResponse()

    @call
    def CfgAnlgWindowStartTrig(self, request, context):  # noqa: N802
        task = self._task(request)
        task.set_trigger(task.start_trigger, ANALOG_WINDOW, request.trigger_source, RISING)
        _keep_window(task, "START", request)
        return pb.CfgAnlgWindowStartTrigResponse()

    @call
    def CfgAnlgWindowRefTrig(self, request, context):  # noqa: N802
        task = self._task(request)
        source, before = request.trigger_source, request.pretrigger_samples
        task.set_trigger(task.reference, ANALOG_WINDOW, source, RISING, before)
        _keep_window(task, "REF", request)
        return pb.CfgAnlgWindowRefTrigResponse()

    @call
    def DisableStartTrig(self, request, context):  # noqa: N802
        task = self._task(request)
        task.remove_trigger(task.start_trigger)
        return pb.DisableStartTrigResponse()

    @call
    def DisableRefTrig(self, request, context):  # noqa: N802
        task = self._task(request)
        task.remove_trigger(task.reference)
        return pb.DisableRefTrigResponse()

    @call
    def CfgInputBuffer(self, request, context):  # noqa: N802
        self._task(request).set_buffer(request.num_samps_per_chan)
        return pb.CfgInputBufferResponse()

    @call
    def ConfigureLogging(self, request, context):  # noqa: N802
        raise DaqmxError(-201312, "The stand-in logs no TDMS files: record with the client.")
