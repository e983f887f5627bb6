"""The same session over Ethernet: no echo, messages marked, a lost handle is a lost line."""

import contextlib
import socket
import threading

import numpy as np
import pytest

from sautereau.rig.load import with_values
from sautereau.robot.controller import play
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.drivers.serial_port import EthernetPort
from sautereau.robot.errors import LineLost, PortUnavailable
from tests.robot.motions import no_keep_alive


@pytest.fixture
def handle():
    """Return a function that serves lines as a controller's Ethernet handle; None hangs up."""
    threads, wrong = [], []

    def serve(server, pairs):
        with server, server.accept()[0] as peer, contextlib.suppress(OSError):
            pending = b""
            for sent, answer in pairs:
                while b"\r" not in pending:
                    if not (data := peer.recv(4096)):
                        return
                    pending += data
                line, pending = pending.split(b"\r", 1)
                if line != sent.encode():
                    wrong.append((sent, line))
                if answer is None:
                    return
                peer.sendall(answer if isinstance(answer, bytes) else answer.encode())
            peer.recv(1)

    def make(pairs):
        server = socket.create_server(("127.0.0.1", 0))
        threads.append(threading.Thread(target=serve, args=(server, pairs), daemon=True))
        threads[-1].start()
        return f"tcp://127.0.0.1:{server.getsockname()[1]}"

    yield make
    for thread in threads:
        thread.join(timeout=60)
        assert not thread.is_alive()
    assert not wrong


def connect(lines):
    return [("CW 1", ":"), lines.connect[1], ("CF I;CW 1", "::"), *lines.rest_of_connect]


def on(rig, port):
    at = with_values(rig, {"controller.port": port})
    return GalilController(at, keep_alive=no_keep_alive)


def test_a_press_over_ethernet(rig, lines, handle, segments):
    port = handle([*connect(lines), *lines.press[len(lines.connect) :]])
    with on(rig, port) as controller, controller.powered():
        np.testing.assert_array_equal(controller.home(), [0, -500_000])
        controller.move_to(segments.start, 100_000)
        play(controller, segments)
        assert len(controller.capture()) == 27


def test_a_lost_handle_is_a_lost_line(rig, lines, handle):
    port = handle([*connect(lines), ("MG _TPA,_TPB", None)])
    with on(rig, port) as controller, pytest.raises(LineLost, match="closed the connection"):
        controller.positions()


@pytest.mark.parametrize("name", ["tcp://127.0.0.1", "tcp://:23"])
def test_a_name_without_host_or_port(rig, name):
    with pytest.raises(PortUnavailable, match=r"write it as tcp://host:port"):
        on(rig, name).connect()


def test_nobody_there(rig):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(PortUnavailable, match="cannot be opened"):
        on(rig, f"tcp://127.0.0.1:{port}").connect()


def test_bytes_come_and_go_like_those_of_a_serial_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = EthernetPort(f"tcp://127.0.0.1:{server.getsockname()[1]}", 0.05)
        with server.accept()[0] as peer:
            assert port.read(1) == b""
            peer.sendall(b"abc")
            assert port.read(2) == b"ab"
            assert port.in_waiting == 1
            port.reset_input_buffer()
            assert port.in_waiting == 0
            assert port.write(b"xyz") == 3
            assert peer.recv(3) == b"xyz"
        with pytest.raises(ConnectionError):
            port.read(1)
        port.close()
