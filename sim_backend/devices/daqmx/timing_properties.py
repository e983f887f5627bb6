"""The properties of timing and triggers."""

from collections.abc import Callable

from sautereau.sim_backend.devices.daqmx.attributes import Attribute, Table, field, kept, table
from sautereau.sim_backend.devices.daqmx.driver_errors import DaqmxError
from sautereau.sim_backend.devices.daqmx.progress import CardTask
from sautereau.sim_backend.devices.daqmx.task import CONTINUOUS, LEAST
from sautereau.sim_backend.devices.daqmx.triggers import NONE, RISING, Trigger, terminal
from sautereau.sim_backend.devices.daqmx.unsupported import UNFOLLOWED

_SAMPLE_CLOCK, _ON_DEMAND = 10388, 10390
_DEFAULT_RATE = 1000.0


def _set_timing_type(task: CardTask, kind: int) -> None:
    task.must_be_idle()
    if kind not in (_SAMPLE_CLOCK, _ON_DEMAND):
        raise DaqmxError(-200077, f"Sample timing type {kind} is not supported.")
    task.requested_rate = None if kind == _ON_DEMAND else task.requested_rate or _DEFAULT_RATE


def _conversion_rate(task: CardTask) -> float:
    if task.device.simultaneous:
        raise DaqmxError(-200452, "The device has no convert clock: it samples simultaneously.")
    return task.device.conversion_rate(task.rate or _DEFAULT_RATE, max(1, len(task.channels)))


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
            "SAMP_CLK_MAX_RATE": lambda task: task.device.most(len(task.channels)),
            "SAMP_CLK_SRC": field("clock", "", CardTask.clock_terminal),
            "SAMP_CLK_TERM": CardTask.clock_terminal,
            "SAMP_CLK_TIMEBASE_RATE": _timebase,
            "SAMP_CLK_TIMEBASE_SRC": lambda task: f"/{task.card.name}/ai/SampleClockTimebase",
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
            "AI_CONV_RATE": _conversion_rate,
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
        "source", "", lambda task: pick(task).route(task.card) if pick(task).source else "", of=pick
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
                f"{word}_TRIG_TERM": lambda task: terminal(pick(task).source, task.card),
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
