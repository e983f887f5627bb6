"""Real pyserial over the stand-in's lines."""

import sys
import threading

import pytest
import serial

from sautereau.sim_backend.devices.ports import PtyPort, SocketPort

PORTS = [
    pytest.param(
        PtyPort, marks=pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")
    ),
    SocketPort,
]
pytestmark = pytest.mark.parametrize("port_class", PORTS)


def test_no_byte_is_lost_under_large_writes_either_way(port_class):
    data = bytes(range(256)) * 2000
    with (
        port_class(lambda chunk: chunk + chunk) as port,
        serial.serial_for_url(port.url, timeout=30) as line,
    ):
        writer = threading.Thread(target=line.write, args=(data,))
        writer.start()
        received = line.read(2 * len(data))
        writer.join()
    assert len(received) == 2 * len(data)
    # Each chunk came twice in a row, in order: every byte value is there as often as it must be.
    assert all(received.count(value) == 4000 for value in (0, 3, 4, 10, 13, 17, 19, 26, 255))


def test_a_host_that_goes_away_in_mid_answer_harms_nobody(port_class):
    with port_class(lambda chunk: b"x" * 200_000) as port:
        with serial.serial_for_url(port.url, timeout=60) as line:
            line.write(b"?")
            assert line.read(10) == b"x" * 10
        with serial.serial_for_url(port.url, timeout=60) as line:
            line.write(b"?")
            assert line.read(10) == b"x" * 10


def test_a_failing_handler_is_reported_at_the_end(port_class):
    called = threading.Event()

    def fail(data):
        called.set()
        raise ValueError("the handler broke")

    def use():
        with port_class(fail) as port, serial.serial_for_url(port.url, timeout=60) as line:
            line.write(b"x")
            assert called.wait(60)

    with pytest.raises(ValueError, match="the handler broke"):
        use()
