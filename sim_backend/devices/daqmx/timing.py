"""Timing, triggers and buffer of a task: the calls that configure them, and their properties."""

from collections.abc import Callable, Mapping
from typing import Any

from sautereau.sim_backend.devices.daqmx import progress
from sautereau.sim_backend.devices.daqmx.attributes import (
    Attribute,
    Table,
    call,
    field,
    given,
    kept,
    number,
    table,
)
from sautereau.sim_backend.devices.daqmx.card import DaqmxError, Module, invalid
from sautereau.sim_backend.devices.daqmx.progress import CardTask
from sautereau.sim_backend.devices.daqmx.task import (
    ANALOG_EDGE,
    ANALOG_WINDOW,
    CONTINUOUS,
    DIGITAL_EDGE,
    EXPORTS,
    LEAST,
    NONE,
    RISING,
    UNFOLLOWED,
    TaskSettings,
    Trigger,
    terminal,
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
        for name, word in kept.items():
            task.stored[number("TRIGGER", name.format(which.upper()))] = given(request, word)

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
        progress.PATH: request.file_path,
        progress.MODE: given(request, "logging_mode"),
        progress.GROUP: request.group_name,
        progress.OPERATION: given(request, "operation"),
    }


def _export(self: Any, request: Any, context: Any) -> None:
    task, signal = self._task(request), given(request, "signal_id")
    task.must_be_idle()
    if signal not in EXPORTS:
        raise invalid("the signal to export", signal, f"one of {list(EXPORTS)}")
    task.stored[number("EXPORTSIGNAL", EXPORTS[signal])] = request.output_terminal


CONFIGURING = {
    name: call(method, name)
    for name, method in {
        "CfgSampClkTiming": _configure_clock,
        "CfgInputBuffer": lambda self, request, _: self._task(request).set_buffer(
            request.num_samps_per_chan
        ),
        "ConfigureLogging": _configure_logging,
        "ExportSignal": _export,
        "StartNewFile": lambda self, request, _: self._task(request).stored.update(
            {progress.PATH: request.file_path}
        ),
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


_SAMPLE_CLOCK, _ON_DEMAND = 10388, 10390
_DEFAULT_RATE = 1000.0


def _set_timing_type(task: CardTask, kind: int) -> None:
    task.must_be_idle()
    if kind not in (_SAMPLE_CLOCK, _ON_DEMAND):
        raise DaqmxError(-200077, f"Sample timing type {kind} is not supported.")
    task.requested_rate = None if kind == _ON_DEMAND else task.requested_rate or _DEFAULT_RATE


def conversion_rate(task: CardTask, module: Module) -> float:
    """Return the rate [Hz] at which the multiplexer of a task's device converts its inputs."""
    if module.device.simultaneous:
        raise DaqmxError(-200452, "The device has no convert clock: it samples simultaneously.")
    n_inputs = sum(channel.module == module for channel in task.channels.values())
    return module.device.conversion_rate(task.rate or _DEFAULT_RATE, max(1, n_inputs))


def _timebase(task: CardTask) -> float:
    if task.device.timebase is None:
        raise DaqmxError(-200452, "The device has no sample clock timebase.")
    return task.device.timebase


_RATE = field("requested_rate", _DEFAULT_RATE, lambda task: task.rate or _DEFAULT_RATE)


def _set_divisor(task: CardTask, divisor: int) -> None:
    task.must_be_idle()
    task.requested_rate = _timebase(task) / divisor


TIMING = {
    **table(
        "TIMING",
        {
            "SAMP_CLK_RATE": _RATE,
            "SAMP_CLK_MAX_RATE": CardTask.most_rate,
            "SAMP_CLK_SRC": field("clock", "", CardTask.clock_terminal),
            "SAMP_CLK_TERM": CardTask.clock_terminal,
            "SAMP_CLK_TIMEBASE_RATE": _timebase,
            "SAMP_CLK_TIMEBASE_SRC": lambda task: f"/{task.modules[0].name}/ai/SampleClockTimebase",
            "SAMP_CLK_TIMEBASE_DIV": Attribute(
                lambda task: round(_timebase(task) / (task.rate or _DEFAULT_RATE)),
                _set_divisor,
                _RATE.clear,
            ),
            "SAMP_CLK_ACTIVE_EDGE": field("clock_edge", RISING),
            "SAMP_QUANT_SAMP_MODE": field("mode", CONTINUOUS),
            "SAMP_QUANT_SAMP_PER_CHAN": field("n_samples", 1000, CardTask.checked_samples),
            "SAMP_TIMING_TYPE": Attribute(
                lambda task: _ON_DEMAND if task.requested_rate is None else _SAMPLE_CLOCK,
                _set_timing_type,
                lambda task: _set_timing_type(task, _ON_DEMAND),
            ),
            "AI_CONV_RATE": lambda task: conversion_rate(task, task.modules[0]),
            "AI_CONV_MAX_RATE": lambda task: task.device.fastest_many,
        },
    ),
    **kept(
        "TIMING",
        {
            "REF_CLK_SRC": "",
            "REF_CLK_RATE": 10e6,
            "SYNC_PULSE_SRC": "",
            "SYNC_PULSE_MIN_DELAY_TO_START": 0.0,
            "SAMP_CLK_DIG_FLTR_ENABLE": False,
            "FIRST_SAMP_TIMESTAMP_ENABLE": False,
            **UNFOLLOWED["TIMING"],
        },
    ),
}


def _of_trigger(pick: Callable[[CardTask], Trigger], word: str) -> Table:
    """Return the properties that a start and a reference trigger have in common.

    Args:
        pick: Returns the trigger of a task.
        word: As in their names: ``START`` in DIG_EDGE_START_TRIG_SRC.
    """
    routed = field(
        *("source", ""),
        lambda task: pick(task).route(task.modules[0]) if pick(task).source else "",
        of=pick,
    )
    kept_ones: dict[str, object] = {
        f"{kind}_{word}_TRIG_DIG_FLTR_{what}": default
        for kind in ("DIG_EDGE", "ANLG_EDGE")
        for what, default in (
            ("ENABLE", False),
            ("MIN_PULSE_WIDTH", 0.0),
            ("TIMEBASE_SRC", ""),
            ("TIMEBASE_RATE", 0.0),
        )
    }
    return {
        **table(
            "TRIGGER",
            {
                f"{word}_TRIG_TYPE": field("kind", NONE, of=pick),
                f"DIG_EDGE_{word}_TRIG_SRC": routed,
                f"ANLG_EDGE_{word}_TRIG_SRC": routed,
                f"ANLG_WIN_{word}_TRIG_SRC": routed,
                f"DIG_EDGE_{word}_TRIG_EDGE": field("edge", RISING, of=pick),
                f"ANLG_EDGE_{word}_TRIG_SLOPE": field("edge", RISING, of=pick),
                f"{word}_TRIG_TERM": lambda task: terminal(pick(task).source, task.modules[0]),
            },
        ),
        **kept(
            "TRIGGER",
            {
                f"ANLG_EDGE_{word}_TRIG_LVL": 0.0,
                f"ANLG_EDGE_{word}_TRIG_HYST": 0.0,
                f"ANLG_EDGE_{word}_TRIG_COUPLING": 10050,
                f"ANLG_WIN_{word}_TRIG_TOP": 0.0,
                f"ANLG_WIN_{word}_TRIG_BTM": 0.0,
                f"ANLG_WIN_{word}_TRIG_WHEN": 10163,
                **kept_ones,
            },
        ),
    }


TRIGGER = {
    **_of_trigger(lambda task: task.start_trigger, "START"),
    **_of_trigger(lambda task: task.reference, "REF"),
    **table("TRIGGER", {"REF_TRIG_PRETRIG_SAMPLES": field("before", LEAST)}),
    **kept("TRIGGER", {"START_TRIG_RETRIGGERABLE": False, **UNFOLLOWED["TRIGGER"]}),
}
