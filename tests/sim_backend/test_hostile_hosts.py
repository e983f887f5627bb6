"""The stand-in's ports under garbage, a thousand connections and readers that never read."""

import contextlib
import os
import resource
import socket
import threading
import time
from pathlib import Path

import grpc
import numpy as np
import pytest
from nidaqmx._stubs import nidaqmx_pb2 as pb

from sautereau.daq.source.acquisition import Acquisition
from sautereau.rig.load import with_values
from sautereau.sim_backend.devices.daqmx.server import DaqmxServer
from sautereau.sim_backend.devices.galil.firmware import GalilFirmware
from sautereau.sim_backend.devices.ports import MOST_UNREAD, PtyPort, SocketPort
from tests.cards import Card
from tests.fuzz.protocols import Unmoved

CONNECTIONS = 1000


@pytest.fixture
def card(paper):
    """A served card, and what acquires from it."""
    before = threading.active_count()
    with DaqmxServer(Card()) as server:
        values = {"daq.address": server.address, "daq.trigger_timeout": "5 s"}
        daq = with_values(paper, values).daq

        def acquire():
            with Acquisition(daq, 0.05) as acquisition:
                acquisition.start()
                return sum(block.volts.shape[1] for block in acquisition.blocks())

        yield server, acquire
    until = time.monotonic() + 60
    while threading.active_count() > before and time.monotonic() < until:
        time.sleep(0.01)  # gRPC ends its own threads later


def connected(address, n):
    """Open n connections, as far as the system allows."""
    low, high = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(high, max(low, 4 * n)), high))
    host, _, port = address.rpartition(":")
    found = []
    with contextlib.suppress(OSError):
        for _ in range(n):
            found.append(socket.create_connection((host, int(port)), timeout=5))
    return found


@pytest.mark.parametrize("size", [10, 100_000])
def test_garbage_at_the_cards_port(card, size):
    server, acquire = card
    garbage = np.random.default_rng(size).bytes(size)
    for head in (b"", b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", b"GET / HTTP/1.1\r\n\r\n"):
        (end,) = connected(server.address, 1)
        with end, contextlib.suppress(OSError):
            end.sendall(head + garbage)
    assert acquire() == 2560


@pytest.mark.slow
def test_a_thousand_connections_to_the_card(card):
    server, acquire = card
    ends = connected(server.address, CONNECTIONS)
    assert len(ends) == CONNECTIONS
    with SocketPort(lambda data: data.upper()) as port:  # its descriptors are above 1023
        assert asked(port, b"abc") == b"ABC"
        assert acquire() == 2560
    for end in ends:
        end.close()


def asked(port, data):
    (end,) = connected(port.url.removeprefix("socket://"), 1)
    with end:
        end.sendall(data)
        return end.recv(100)


def test_huge_and_wrong_messages_at_the_card(card):
    server, acquire = card
    with grpc.insecure_channel(server.address) as channel:
        for data in (b"\xff" * 100, bytes(5 << 20)):
            call = channel.unary_unary("/nidaqmx_grpc.NiDAQmx/CreateTask")
            with pytest.raises(grpc.RpcError):
                call(data, timeout=60)
        with pytest.raises(grpc.RpcError) as caught:
            channel.unary_unary("/nidaqmx_grpc.NiDAQmx/NoSuchCall")(b"", timeout=60)
        assert caught.value.code() is grpc.StatusCode.UNIMPLEMENTED
        wrong = pb.StartTaskRequest()
        wrong.task.name = "\x1b[2J" * 1000
        with pytest.raises(grpc.RpcError):
            channel.unary_unary("/nidaqmx_grpc.NiDAQmx/StartTask")(wrong.SerializeToString())
    assert acquire() == 2560


def test_one_after_another_at_the_controllers_port():
    with SocketPort(lambda data: data.upper()) as port:
        for _ in range(50):
            for end in connected(port.url.removeprefix("socket://"), 1):
                end.close()
        assert asked(port, b"abc") == b"ABC"


def test_a_host_that_never_reads():
    """Its commands wait, so that the answers do not grow without end; others are not delayed."""
    taken = []

    def handler(data):
        taken.append(len(data))
        return data * 100

    with SocketPort(handler) as port:
        (end,) = connected(port.url.removeprefix("socket://"), 1)
        end.settimeout(0.2)
        with end, contextlib.suppress(TimeoutError):
            for _ in range(4000):
                end.sendall(bytes(4096))
        kernel = 16 << 20  # buffers of the loopback
        assert 100 * sum(taken) < MOST_UNREAD + 100 * 4096 + kernel


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo-terminals")
def test_the_pseudo_terminal_is_the_users_alone():
    with PtyPort(bytes.upper) as port:
        about = Path(port.url).stat()
        assert about.st_uid == os.getuid()
        assert not about.st_mode & 0o007
        assert not about.st_mode & 0o040


def test_the_servers_listen_on_the_loopback_only(card):
    server, _ = card
    assert server.address.startswith("127.0.0.1:")
    with SocketPort(bytes) as port:
        assert port.url.startswith("socket://127.0.0.1:")


def test_twelve_endless_reads_leave_a_worker_for_the_others(card):
    server, acquire = card
    with grpc.insecure_channel(server.address) as channel:

        def read():
            name = threading.current_thread().name
            create = pb.CreateTaskRequest(session_name=name).SerializeToString()
            channel.unary_unary("/nidaqmx_grpc.NiDAQmx/CreateTask")(create)
            request = pb.ReadAnalogF64Request(num_samps_per_chan=10**9, timeout=-1.0)
            request.task.name = name
            with contextlib.suppress(grpc.RpcError):
                path = "/nidaqmx_grpc.NiDAQmx/ReadAnalogF64"
                channel.unary_unary(path)(request.SerializeToString(), timeout=1.0)

        threads = [threading.Thread(target=read) for _ in range(12)]
        for thread in threads:
            thread.start()
        time.sleep(0.1)
        assert acquire() == 2560
        for thread in threads:
            thread.join()


@pytest.mark.parametrize("form", ["F999999999.4", "Z1.99999999", "$-999999999"])
def test_a_format_of_very_many_digits_is_refused_at_once(form):
    firmware = GalilFirmware(Unmoved(), on_output=lambda number, level: None)
    assert firmware.receive(f"EO 0\rMG 1{{{form}}}\r".encode()).endswith(b"?")
