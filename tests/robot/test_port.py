"""Ports that are missing, forbidden or in use, and real pyserial without an answer."""

import os
import re

import pytest
import serial

from sautereau.rig.load import with_values
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.drivers.serial_port import open_port
from sautereau.robot.errors import PortUnavailable


@pytest.mark.parametrize("name", ["/dev/no_such_port", "odd://thing", "socket://127.0.0.1:1"])
def test_a_missing_port_is_named_with_the_ports_of_this_machine(rig, name):
    controller = GalilController(with_values(rig, {"controller.port": name}))
    said = rf"{re.escape(name)}.*controller\.port.*ports of this machine"
    with pytest.raises(PortUnavailable, match=said) as caught:
        controller.connect()
    assert "[Errno" not in str(caught.value)


@pytest.mark.parametrize(
    ("number", "text", "fix"),
    [
        (13, "Permission denied", "dialout"),
        (16, "Device or resource busy", "another program"),
        (11, "Could not exclusively lock port", "another program"),
    ],
)
def test_a_port_that_may_not_be_opened(monkeypatch, number, text, fix):
    def refuse(*_, **__):
        raise serial.SerialException(number, text)

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(PortUnavailable, match=fix):
        open_port("/dev/ttyUSB0", 115200, 0.1)


def test_a_port_is_opened_for_one_program(terminal, lines):
    controller, end = terminal(lines.connect)
    with controller, pytest.raises(PortUnavailable, match="another program"):
        open_port(end.port, 115200, 0.1)


@pytest.mark.parametrize("url", ["spy:///dev/null?file=seen.txt", "hwgrep://.*", "alt:///dev/null"])
def test_urls_that_are_no_port_of_a_controller_are_refused(url, tmp_path, monkeypatch):
    """One of pyserial's would write a file that the rig names."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(PortUnavailable, match="is not one of tcp, socket"):
        open_port(url, 115_200, 0.1)
    assert list(tmp_path.iterdir()) == []


def test_a_serial_port_is_asked_for_low_latency(monkeypatch):
    asked = []
    monkeypatch.setattr(serial.Serial, "set_low_latency_mode", lambda _, on: asked.append(on))
    main, device = os.openpty()
    try:
        open_port(os.ttyname(device), 115_200, 0.1).close()
        monkeypatch.undo()
        open_port(os.ttyname(device), 115_200, 0.1).close()  # it has no such mode
    finally:
        os.close(main)
        os.close(device)
    assert asked == [True]
