"""Continuous tasks, buffers and reference triggers of the DAQmx stand-in, by the real nidaqmx."""

import contextlib
from dataclasses import replace

import pytest
from nidaqmx import DaqError, Task
from nidaqmx.constants import READ_ALL_AVAILABLE, AcquisitionType, Edge, ReadRelativeTo
from nidaqmx.error_codes import DAQmxErrors

from sautereau.sim_backend.device_types import IDEAL
from tests.cards import Card, code_of, volts


@pytest.fixture
def task_on(serve):
    """Return a function that makes a task of one channel on a card."""
    with contextlib.ExitStack() as tasks:

        def make(card, n, mode=AcquisitionType.CONTINUOUS, rate=1000.0):
            task = tasks.enter_context(Task(grpc_options=serve(card)))
            task.ai_channels.add_ai_voltage_chan("Dev1/ai0")
            task.timing.cfg_samp_clk_timing(rate, sample_mode=mode, samps_per_chan=n)
            return task

        yield make


def test_a_continuous_task_gives_what_there_is_and_is_never_done(task_on):
    card = Card(1, ready=0)
    task = task_on(card, 1000)
    task.start()
    card.ready = 300
    assert task.timing.samp_quant_samp_mode == AcquisitionType.CONTINUOUS
    assert task.in_stream.avail_samp_per_chan == 300
    assert task.read(100) == list(volts(0, 100)[0])
    assert task.read(READ_ALL_AVAILABLE) == list(volts(100, 200)[0])
    assert task.in_stream.curr_read_pos == 300
    assert not task.is_task_done()
    assert code_of(task.read, 1, timeout=0.01) == DAQmxErrors.SAMPLES_NOT_YET_AVAILABLE.value
    task.stop()
    assert task.is_task_done()


@pytest.mark.parametrize(
    ("rate", "wanted", "buffer"),
    [(100, 2, 1_000), (101, 2, 10_000), (51_200, 2, 100_000), (51_200, 200_000, 200_000)],
)
def test_the_driver_chooses_a_buffer_by_the_rate(task_on, rate, wanted, buffer):
    task = task_on(Card(1, ready=0), wanted, rate=rate)
    assert task.in_stream.input_buf_size == buffer


def test_samples_beyond_the_buffer_are_overwritten(task_on):
    card = Card(1, ready=0)
    task = task_on(card, 1000)
    task.in_stream.input_buf_size = 500
    task.start()
    card.ready = 500
    assert len(task.read(10)) == 10
    card.ready = 510
    assert len(task.read(10)) == 10
    card.ready = 521
    for _ in range(2):
        assert code_of(task.read, 10) == DAQmxErrors.SAMPLES_NO_LONGER_AVAILABLE.value
    task.stop()
    card.ready = 10
    task.start()
    assert task.read(10)[0] == volts(0, 1)[0, 0]


def test_a_card_that_waits_for_its_reader_overwrites_nothing(task_on):
    card = Card(1, ready=0, paced=False)
    task = task_on(card, 2)
    task.in_stream.input_buf_size = 20
    task.start()
    card.ready = 1000
    assert len(task.read(1000)) == 1000


def test_a_finite_buffer_holds_it_all(task_on):
    task = task_on(Card(1, ready=0), 100, AcquisitionType.FINITE)
    with pytest.raises(DaqError, match="100 or more"):
        task.in_stream.input_buf_size = 99
    task.in_stream.input_buf_size = 200
    assert task.in_stream.input_buf_size == 200


def around(task, before=20):
    task.triggers.reference_trigger.cfg_dig_edge_ref_trig("/Dev1/PFI0", before, Edge.RISING)


def test_by_default_every_read_begins_at_the_first_sample_before_the_edge(task_on):
    card = Card(1, ready=0)
    task = task_on(card, 100, AcquisitionType.FINITE)
    around(task)
    assert task.in_stream.relative_to == ReadRelativeTo.FIRST_PRETRIGGER_SAMPLE
    task.start()
    card.ready = 100
    assert task.read(50) == task.read(50)


def test_reference_triggers_that_are_not_possible(task_on):
    task = task_on(Card(1, ready=0), 100, AcquisitionType.FINITE)
    assert code_of(around, task, 1) == DAQmxErrors.INVALID_ATTRIBUTE_VALUE.value
    around(task, 99)
    assert code_of(task.start) == DAQmxErrors.TOO_MANY_PRETRIG_PLUS_MIN_POST_TRIG_SAMPS.value
    task.timing.cfg_samp_clk_timing(1000, sample_mode=AcquisitionType.CONTINUOUS)
    assert code_of(task.start) == DAQmxErrors.REF_TRIG_WHEN_CONTINUOUS.value
    task.triggers.reference_trigger.disable_ref_trig()
    task.start()
    device = replace(IDEAL, reference_trigger=False)
    plain = task_on(Card(1, ready=0, device=device), 100, AcquisitionType.FINITE)
    around(plain)
    assert code_of(plain.start) == DAQmxErrors.ATTRIBUTE_NOT_SUPPORTED_IN_TASK_CONTEXT.value
