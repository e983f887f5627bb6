"""The calls that configure timing, triggers and buffer of a task."""

from collections.abc import Callable, Mapping
from typing import Any

from sautereau.sim_backend.devices.daqmx import tdms_log
from sautereau.sim_backend.devices.daqmx.attributes import call, given, number
from sautereau.sim_backend.devices.daqmx.task import TaskSettings
from sautereau.sim_backend.devices.daqmx.triggers import (
    ANALOG_EDGE,
    ANALOG_WINDOW,
    DIGITAL_EDGE,
    RISING,
    Trigger,
)

_START, _REFERENCE = "Start", "Ref"
_TRIGGERS: dict[str, tuple[int, str, Mapping[str, str]]] = {
    "DigEdge": (DIGITAL_EDGE, "trigger_edge", {}),
    "AnlgEdge": (ANALOG_EDGE, "trigger_slope", {"ANLG_EDGE_{}_TRIG_LVL": "trigger_level"}),
    "AnlgWindow": (
        ANALOG_WINDOW,
        "",
        {
            "ANLG_WIN_{}_TRIG_TOP": "window_top",
            "ANLG_WIN_{}_TRIG_BTM": "window_bottom",
            "ANLG_WIN_{}_TRIG_WHEN": "trigger_when",
        },
    ),
}
"""The kinds of triggers, by the word in the names of their calls: the trigger's type, the field of
its edge (empty if it has none), and the fields that are only stored, by property."""


def _trigger(task: TaskSettings, which: str) -> Trigger:
    return task.reference if which == _REFERENCE else task.start_trigger


def _configure_trigger(kind: str, which: str) -> Callable[..., None]:
    number_of_kind, edge, kept = _TRIGGERS[kind]

    def configure(self: Any, request: Any, context: Any) -> None:
        task = self._task(request)
        task.set_trigger(
            _trigger(task, which),
            number_of_kind,
            request.trigger_source,
            given(request, edge) if edge else RISING,
            request.pretrigger_samples if which == _REFERENCE else None,
        )
        for name, field in kept.items():
            task.stored[number("TRIGGER", name.format(which.upper()))] = given(request, field)

    return configure


def _disable_trigger(which: str) -> Callable[..., None]:
    def disable(self: Any, request: Any, context: Any) -> None:
        task = self._task(request)
        task.remove_trigger(_trigger(task, which))

    return disable


def _configure_clock(self: Any, request: Any, context: Any) -> None:
    self._task(request).set_clock(
        request.source,
        request.rate,
        given(request, "active_edge"),
        given(request, "sample_mode"),
        request.samps_per_chan,
    )


def _configure_logging(self: Any, request: Any, context: Any) -> None:
    task = self._task(request)
    task.must_be_idle()
    task.stored |= {
        tdms_log.PATH: request.file_path,
        tdms_log.MODE: given(request, "logging_mode"),
        tdms_log.GROUP: request.group_name,
        tdms_log.OPERATION: given(request, "operation"),
    }


def _start_new_file(self: Any, request: Any, context: Any) -> None:
    self._task(request).stored[tdms_log.PATH] = request.file_path


CONFIGURING = {
    name: call(method, name)
    for name, method in {
        "CfgSampClkTiming": _configure_clock,
        "CfgInputBuffer": lambda self, request, _: self._task(request).set_buffer(
            request.num_samps_per_chan
        ),
        "ConfigureLogging": _configure_logging,
        "StartNewFile": _start_new_file,
        "DisableStartTrig": _disable_trigger(_START),
        "DisableRefTrig": _disable_trigger(_REFERENCE),
        **{
            f"Cfg{kind}{which}Trig": _configure_trigger(kind, which)
            for kind in _TRIGGERS
            for which in (_START, _REFERENCE)
        },
    }.items()
}
"""Methods that configure a task, by the call of nidaqmx.proto."""
