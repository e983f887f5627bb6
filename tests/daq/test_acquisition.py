"""The real nidaqmx, over loopback gRPC, against a card of noise; and every fault's message."""

import math
import socket

import grpc
import nidaqmx
import numpy as np
import pytest
from nidaqmx.constants import TaskMode

from sautereau.daq.errors import DaqError
from sautereau.daq.source.acquisition import Acquisition
from tests.cards import Card, volts


def acquire(daq, after_block=lambda: None):
    """Run a complete acquisition of 50 ms."""
    with Acquisition(daq, 0.05) as acquisition:
        acquisition.start()
        for _ in acquisition.blocks():
            after_block()


def fault_of(daq, after_block=lambda: None):
    """Return the one error that a complete acquisition raises."""
    with pytest.raises(DaqError) as caught:
        acquire(daq, after_block)
    return caught.value


def test_samples_are_bit_exact(bench, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    card, _, rig = bench()
    with Acquisition(rig.daq, 0.5) as acquisition:
        assert acquisition.n_samples == 25_600
        assert acquisition.rate == 51_200.0
        assert acquisition.simulated is True
        assert "stand-in" in acquisition.device_description
        acquisition.start()
        blocks = list(acquisition.blocks())
        acquisition.stop()
    assert [block.first_sample for block in blocks] == list(range(0, 25_600, 1024))
    found = np.concatenate([block.volts for block in blocks], axis=1)
    assert np.array_equal(found.view(np.uint64), volts(0, 25_600, 2).view(np.uint64))
    assert card.setups[-1].terminals == ("Dev1/ai0", "Dev1/ai1")
    assert card.setups[-1].trigger == "/Dev1/PFI0"
    assert card.runs[0].stopped.is_set()
    assert list((tmp_path / "sautereau").iterdir()) == []  # its lock is removed


def test_the_last_block_is_shorter_and_duration_is_rounded_up(bench):
    _, _, rig = bench(daq__block=1000)
    with Acquisition(rig.daq, 2500.2 / 51_200) as acquisition:
        acquisition.start()
        assert [block.volts.shape for block in acquisition.blocks()] == [
            (2, 1000),
            (2, 1000),
            (2, 501),
        ]


def test_leaving_by_an_exception_frees_the_card(bench):
    card, _, rig = bench()
    with pytest.raises(ZeroDivisionError):
        acquire(rig.daq, lambda: 1 / 0)
    assert card.runs[0].stopped.is_set()
    with Acquisition(rig.daq, 0.05) as acquisition:
        acquisition.start()
        assert sum(block.volts.shape[1] for block in acquisition.blocks()) == 2560


def test_no_driver(paper):
    message = str(fault_of(paper.daq))
    assert "driver is not installed" in message
    assert "daq.address" in message
    assert "--sim" in message


def test_no_server(paper):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    message = str(fault_of(paper.daq.model_copy(update={"address": address})))
    assert address in message
    assert "2 s" in message
    assert "start NI's gRPC device server" in message


@pytest.mark.parametrize(
    "address", ["192.168.1.20:31763", "daq.example.org:31763", "0.0.0.0:31763", "[2001:db8::1]:1"]
)
def test_another_machine_is_refused(paper, address):
    message = str(fault_of(paper.daq.model_copy(update={"address": address})))
    assert address in message
    assert "daq.tls" in message
    assert "daq.insecure = true" in message


@pytest.mark.parametrize("address", ["localhost", "127.0.0.1:", "127.0.0.1:99999", ":31763"])
def test_an_address_that_is_none(paper, address):
    assert "not host:port" in str(fault_of(paper.daq.model_copy(update={"address": address})))


@pytest.mark.parametrize(
    ("card", "values", "words"),
    [
        ({}, {"daq.channels.1.terminal": "ai7"}, ["ai7", "-200170", "it has Dev1/ai0, Dev1/ai1"]),
        ({}, {"daq.device": "Dev9"}, ["Dev9", "the driver knows Dev1", "daq.device"]),
        ({}, {"daq.trigger_source": "ao/StartTrigger"}, ["-89120", "setting up"]),
        ({}, {"daq.channels.1.range": "12 V"}, ["-200077"]),
        ({"ready": 0}, {}, ["/Dev1/PFI0", "0.3 s", "controller.trigger_output", "cable"]),
        ({"ready": 1500}, {}, ["stopped at 1500 of 2560", "daq.trigger_timeout"]),
        ({"fault": (1024, -200279)}, {}, ["-200279", "daq.block"]),
    ],
)
def test_each_fault_of_the_device_says_how_to_fix_it(bench, card, values, words):
    card, _, rig = bench(Card(**card), **values)
    message = str(fault_of(rig.daq))
    assert [word for word in words if word not in message] == []
    assert all(run.stopped.is_set() for run in card.runs)


def test_a_card_in_use_is_refused_before_it_is_started(bench):
    _, _, rig = bench()
    with Acquisition(rig.daq, 0.05):
        fault = fault_of(rig.daq)
    assert "another program uses it" in str(fault)


def test_a_card_in_use_by_another_program(bench):
    _, server, rig = bench()
    with (
        grpc.insecure_channel(server.address) as channel,
        nidaqmx.Task(grpc_options=nidaqmx.GrpcSessionOptions(channel, "")) as other,
    ):
        other.ai_channels.add_ai_voltage_chan("Dev1/ai0")
        other.control(TaskMode.TASK_RESERVE)
        assert "another task or program holds it" in str(fault_of(rig.daq))


KILLED = """
import os, signal, sys
from sautereau.daq.source.acquisition import Acquisition
from sautereau.rig.load import load_rig, with_values
rig = with_values(load_rig("paper"), {"daq.address": sys.argv[1]})
with Acquisition(rig.daq, 0.05) as acquisition:
    acquisition.start()
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_the_session_of_a_killed_client_is_cleared(bench, command_server, tmp_path):
    card, server, rig = bench()
    killed = command_server.run("-c", KILLED, server.address, folder=tmp_path)
    assert (killed.returncode, killed.stderr) == (1, "")
    assert not card.runs[0].stopped.is_set()
    with Acquisition(rig.daq, 0.05) as acquisition:
        acquisition.start()
        assert sum(block.volts.shape[1] for block in acquisition.blocks()) == 2560
    assert card.runs[0].stopped.is_set()


def test_server_gone_in_mid_read(bench):
    _, server, rig = bench()
    fault = fault_of(rig.daq, lambda: server.__exit__(None, None, None))
    assert "no answer while reading" in str(fault)
    (note,) = fault.__notes__
    assert "clearing the task failed" in note


def test_server_gone_at_the_end_is_reported(bench):
    _, server, rig = bench()
    with pytest.raises(DaqError, match="while clearing"), Acquisition(rig.daq, 0.05):
        server.__exit__(None, None, None)


def test_a_hung_server_is_a_fault(bench, monkeypatch):
    class Hung(Card):
        def start(self, setup):
            run = super().start(setup)
            run.wait_for = lambda n, timeout: run.stopped.wait() and 0
            return run

    monkeypatch.setattr("sautereau.daq.source.connection.ANSWER_DEADLINE", 2.0)
    _, _, rig = bench(Hung())
    assert "no answer while reading" in str(fault_of(rig.daq))


@pytest.mark.parametrize("duration", [0.0, -1.0, math.nan, math.inf])
def test_a_duration_that_is_none(paper, duration):
    with pytest.raises(DaqError, match="duration"):
        Acquisition(paper.daq, duration)


def test_use_outside_the_context(paper):
    acquisition = Acquisition(paper.daq, 0.1)
    for use in (acquisition.start, acquisition.stop, lambda: next(acquisition.blocks())):
        with pytest.raises(DaqError, match="inside `with"):
            use()
    with pytest.raises(DaqError, match="inside `with`"):
        _ = acquisition.simulated
