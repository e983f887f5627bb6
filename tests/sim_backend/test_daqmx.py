"""The DAQmx stand-in, asked by the real, unmodified nidaqmx over loopback gRPC."""

import threading

import grpc
import numpy as np
import pytest
from nidaqmx import DaqError, GrpcSessionOptions, Task
from nidaqmx.constants import READ_ALL_AVAILABLE, AcquisitionType, TaskMode
from nidaqmx.errors import DaqReadError, RpcError
from nidaqmx.stream_readers import AnalogMultiChannelReader
from nidaqmx.system import Device, System

from sautereau.sim_backend.devices.daqmx.server import DaqmxServer
from tests.cards import Card, code_of, served, volts


@pytest.fixture
def card():
    return Card(4)


@pytest.fixture
def options(card):
    with served(card, ("grpc.max_receive_message_length", 64 * 2**20)) as options:
        yield options
    assert not [t for t in threading.enumerate() if t.name.startswith("daqmx stand-in")]


@pytest.fixture
def task(options):
    with Task(grpc_options=options) as task:
        yield task


def finite(task, n_samples, rate=51_200.0, channels="Dev1/ai0:1"):
    task.ai_channels.add_ai_voltage_chan(channels)
    task.timing.cfg_samp_clk_timing(
        rate, sample_mode=AcquisitionType.FINITE, samps_per_chan=n_samples
    )


def test_a_large_read_in_one_answer(card, task):
    finite(task, 400_000)
    assert np.array_equal(task.read(READ_ALL_AVAILABLE), volts(0, 400_000, 2))


def test_plain_reads(card, task):
    task.ai_channels.add_ai_voltage_chan("Dev1/ai2")
    assert task.read() == volts(0, 1)[0, 0]
    assert task.read(4) == list(volts(0, 4)[0])
    task.ai_channels.add_ai_voltage_chan("Dev1/ai3", "second")
    assert task.read() == list(volts(0, 1, 2)[:, 0])
    assert task.channel_names == ["Dev1/ai2", "second"]


def test_a_task_read_without_start_can_be_read_again(card, task):
    finite(task, 100)
    for _ in range(2):
        assert np.array_equal(task.read(100), volts(0, 100, 2))
    assert len(card.setups) == 2


def test_a_partial_read_gives_what_is_there(card, task):
    finite(task, 1000)
    card.ready = 300
    task.start()
    reader = AnalogMultiChannelReader(task.in_stream)
    found = np.full((2, 1000), -1.0)
    with pytest.raises(DaqReadError) as caught:
        reader.read_many_sample(found, 1000, timeout=0.05)
    assert caught.value.error_code == -200284
    assert caught.value.samps_per_chan_read == 300
    # NI's driver packs them at the beginning of the array (nidaqmx-python #528).
    assert np.array_equal(found.ravel()[:600].reshape(2, 300), volts(0, 300, 2))
    assert code_of(task.wait_until_done, timeout=0.05) == -200560
    assert not task.is_task_done()
    assert task.in_stream.avail_samp_per_chan == 0
    assert task.in_stream.total_samp_per_chan_acquired == 300


def test_the_device_says_that_it_is_simulated(options):
    system = System.remote(options)
    assert system.devices.device_names == ["Dev1"]
    device = Device("dev1", grpc_options=options)
    assert device.is_simulated is True
    assert "sautereau stand-in" in device.product_type
    assert device.serial_num > 0
    assert device.ai_physical_chans.channel_names == [f"Dev1/ai{n}" for n in range(4)]
    assert device.ai_voltage_rngs == [-10.0, 10.0]
    assert device.ao_physical_chans.channel_names == []
    assert code_of(getattr, Device("Dev9", grpc_options=options), "product_type") == -200220


def test_channels_that_are_not_there(task):
    add = task.ai_channels.add_ai_voltage_chan
    assert code_of(add, "Dev1/ai4") == code_of(add, "Dev1/ao0") == -200170
    assert code_of(add, "Dev2/ai0") == -200220
    assert code_of(add, "") == -200099


@pytest.mark.parametrize(
    ("settings", "code"),
    [
        ({"high": 11.0}, -200077),
        ({"high": -12.0}, -200077),
        ({"rate": 2e6}, -200077),
        ({"clock": "/Dev1/PFI1"}, -200452),
        ({"clock": "/Dev1/RTSI0"}, -89120),
        ({"trigger": "/Dev1/Trigger"}, -89120),
    ],
)
def test_settings_that_are_not_possible_are_refused_when_verified(task, settings, code):
    task.ai_channels.add_ai_voltage_chan(
        "Dev1/ai0", min_val=-5.0, max_val=settings.get("high", 5.0)
    )
    task.timing.cfg_samp_clk_timing(settings.get("rate", 1000.0), settings.get("clock", ""))
    task.triggers.start_trigger.cfg_dig_edge_start_trig(settings.get("trigger", "PFI0"))
    assert code_of(task.control, TaskMode.TASK_VERIFY) == code_of(task.start) == code


def test_a_bad_source_of_the_clock_is_reported_on_query(task):
    task.ai_channels.add_ai_voltage_chan("Dev1/ai0")
    task.timing.cfg_samp_clk_timing(1000, source="/Dev1/RTSI0")
    assert code_of(getattr, task.timing, "samp_clk_src") == -89120
    task.timing.samp_clk_src = "PFI3"
    assert task.timing.samp_clk_src == "/Dev1/PFI3"


def test_a_channel_twice_and_a_mode_that_no_card_has(task):
    add = task.ai_channels.add_ai_voltage_chan
    add("Dev1/ai0")
    assert code_of(add, "Dev1/ai0") == -200489
    clock = task.timing.cfg_samp_clk_timing
    assert code_of(clock, 1000, sample_mode=AcquisitionType.HW_TIMED_SINGLE_POINT) == -200077


def test_the_order_of_calls_matters(options, task):
    assert code_of(task.start) == -200460
    finite(task, 100)
    task.start()
    assert code_of(task.start) == -200479
    assert len(task.read(101)[0]) == 100
    assert code_of(task.read, 1) == -200278
    with Task(grpc_options=options) as other:
        finite(other, 100)
        assert code_of(other.start) == -50103
        assert code_of(other.read, 100) == -50103
        task.control(TaskMode.TASK_ABORT)
        other.start()


def test_a_cleared_task_is_invalid(options):
    task = Task(grpc_options=options)
    handle, interpreter = task._handle, task._interpreter
    task.close()
    assert code_of(interpreter.start_task, handle) == -200088


def test_what_is_not_built_says_so(task):
    with pytest.raises(RpcError, match="UNIMPLEMENTED"):
        task.ao_channels.add_ao_voltage_chan("Dev1/ao0")
    assert code_of(getattr, task.timing, "hshk_delay_after_xfer") == -200197


@pytest.mark.parametrize("channels", ["Dev1/ai0:30000000", "Dev1/ai30000000:0"])
def test_a_range_of_very_many_channels_is_refused(task, channels):
    with pytest.raises(DaqError, match="-200170"):
        task.ai_channels.add_ai_voltage_chan(channels)


def test_a_read_larger_than_an_answer_is_refused(task):
    task.ai_channels.add_ai_voltage_chan("Dev1/ai0")
    task.timing.cfg_samp_clk_timing(1000, sample_mode=AcquisitionType.CONTINUOUS)
    with pytest.raises(DaqError, match="-50352"):
        task._interpreter.read_analog_f64(task._handle, 2**31 - 1, 0.0, 0, np.empty(0))


def test_stopping_the_server_ends_a_read_that_waits(card):
    card.ready = 0
    with DaqmxServer(card) as server, grpc.insecure_channel(server.address) as channel:
        task = Task(grpc_options=GrpcSessionOptions(channel, ""))
        finite(task, 100)
        task.start()
        stopper = threading.Timer(0.1, server.__exit__, (None, None, None))
        stopper.start()
        with pytest.raises((RpcError, DaqError)):
            task.read(100, timeout=-1)
        stopper.join()
        with pytest.raises(RpcError):
            task.close()
