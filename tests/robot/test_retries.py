"""A question that only reads survives the loss or change of any one byte; a command never does."""

import logging

import pytest

from sautereau.rig.load import with_values
from sautereau.robot.drivers.galil.line import Line
from sautereau.robot.drivers.odrive.driver import OdriveController
from sautereau.robot.drivers.odrive.line import OdriveLine, framed
from sautereau.robot.drivers.serial_port import open_port
from sautereau.robot.errors import GarbledAnswer, SilentController, UnaskedText
from sautereau.sim_backend.devices.galil.firmware import GalilFirmware
from sautereau.sim_backend.devices.odrive.firmware import OdriveFirmware
from sautereau.sim_backend.devices.ports import PtyPort
from tests.budget import slow
from tests.emulated import Encoders, ScriptedPort
from tests.robot.motions import no_keep_alive

COUNTS = 19_099, -19_099
CHANGES = [0, 1, *(slow(1 << bit) for bit in range(1, 8))]


class Disturbed(ScriptedPort):
    """A serial port whose line drops or changes one byte, where `hit` says."""

    def __init__(self, receive):
        super().__init__()
        self.receive, self.sent = receive, b""
        self.hit = None
        """Direction, number of the byte from now on, and bits that change, 0 where it is lost."""

    def write(self, data):
        self.sent += data
        self.incoming += self.disturbed("host", self.receive(self.disturbed("controller", data)))

    def disturbed(self, towards, data):
        if self.hit is None or self.hit[0] != towards:
            return data
        _, at, bits = self.hit
        self.hit = (towards, at - len(data), bits)
        if at >= len(data):
            return data
        self.hit = None
        return data[:at] + (bytes([data[at] ^ bits]) if bits else b"") + data[at + 1 :]


def odrive():
    plant = Encoders(COUNTS)
    turns = {"per_turn": (2e6, 2e6), "torque_per_volt": (0.2, 0.2)}
    return OdriveFirmware(plant, period=976e-6, stepped=True, **turns).receive


def galil():
    plant = Encoders(COUNTS)
    firmware = plant.firmware = GalilFirmware(plant, on_output=lambda number, level: None)
    firmware.receive(b"EO 0\rCW 1\rCF I\rDM posA[8]\rposA[3]=5\rDL\r#A\rEN\r\\\r\n")
    return firmware.receive


def odrive_line(port):
    line = OdriveLine(port, "port", 0.1)
    line.resynchronise()
    return line


def galil_line(port):
    line = Line(port, "port", 0.1)
    line.ask("EO 1")
    line.echo = True
    return line


QUESTIONS = {
    "odrive read": (odrive, odrive_line, lambda line: line.read("vbus_voltage")),
    "odrive positions": (odrive, odrive_line, lambda line: line.query("f 0", "f 1", count=2)),
    "odrive many": (
        odrive,
        odrive_line,
        lambda line: line.read_many(
            f"axis{axis}.{name}" for axis in (0, 1) for name in ("motor.error", "current_state")
        ),
    ),
    "galil read": (galil, galil_line, lambda line: line.read("_TPA", "_MOB")),
    "galil upload": (galil, galil_line, lambda line: line.upload("posA", 8)),
    "galil program": (galil, galil_line, lambda line: line.listing()),
}


@pytest.mark.parametrize("bits", CHANGES)
@pytest.mark.parametrize("towards", ["controller", "host"])
@pytest.mark.parametrize("name", QUESTIONS)
def test_a_byte_lost_or_changed_anywhere(name, towards, bits, caplog):
    device, make, ask = QUESTIONS[name]
    caplog.set_level(logging.ERROR)  # hundreds of warnings
    port = Disturbed(device())
    line = make(port)
    port.sent = b""
    due, length = ask(line), len(port.sent) if towards == "controller" else 400
    for position in range(length):
        port.hit = towards, position, bits
        found = ask(line)
        if port.hit is not None:  # beyond the answer
            break
        # An answer of a Galil has no checksum: a changed digit is another number.
        assert found == due or (name.startswith("galil") and towards == "host"), position
        assert ask(line) == due
        assert not port.incoming
    assert position >= 2


def test_the_second_failure_is_raised_and_both_are_logged(caplog):
    port = Disturbed(odrive())
    line = odrive_line(port)
    receive, port.receive = port.receive, lambda data: receive(data).replace(b"24.0", b"25.0")
    with pytest.raises(GarbledAnswer, match=r"'r vbus_voltage' with '25\.0"):
        line.read("vbus_voltage")
    assert port.sent.count(b"r vbus_voltage") == 2
    assert ["asked once more" in each for each in caplog.messages] == [True]


@pytest.mark.parametrize(
    ("device", "make", "command"),
    [
        (odrive, odrive_line, lambda line: line.confirmed("t 0 0.5", "t 1 0.5")),
        (odrive, odrive_line, lambda line: line.set({"axis0.motor.config.torque_lim": 1.0})),
        (galil, galil_line, lambda line: line.ask("PA 5,5")),
        (galil, galil_line, lambda line: line.numbers("MG _TPA", "wsign=0", count=1)),
    ],
    ids=["odrive moves", "odrive sets", "galil moves", "galil clears"],
)
def test_a_command_is_never_sent_twice(device, make, command):
    port = Disturbed(device())
    line = make(port)
    port.sent = b""
    command(line)
    sent, length = port.sent, len(port.receive(b""))
    port.hit, port.sent = ("host", length, 0), b""
    with pytest.raises((GarbledAnswer, SilentController)):
        command(line)
    assert port.sent == sent


@pytest.mark.parametrize(("device", "make"), [(odrive, odrive_line), (galil, galil_line)])
def test_text_that_nobody_asked_for_is_reported_at_once(device, make):
    port = Disturbed(device())
    line = make(port)
    port.sent, port.incoming = b"", b"?7 BT AB\r\n"
    question = "vbus_voltage" if device is odrive else "_TPA"
    with pytest.raises(UnaskedText, match="before it was asked"):
        line.read(question)
    assert not port.sent


def test_a_lost_byte_on_a_pseudo_terminal_while_the_motors_are_on(odrive_rig, caplog):
    """The question is repeated long before the end of a timeout that outlasts the watchdog."""
    port = Disturbed(odrive())

    def receive(data):
        return port.disturbed("host", port.receive(data))

    with PtyPort(receive) as end:
        values = {"controller.port": end.url, "controller.timeout": "1000 s"}
        controller = OdriveController(
            with_values(odrive_rig, values), open_port=open_port, keep_alive=no_keep_alive
        )
        with controller, controller.powered():
            before = controller.positions()
            question = "".join(map(framed, ("f 0", "f 1"))).encode()
            port.hit = "host", len(port.receive(question)) - 1, 0  # the last line feed
            assert (controller.positions() == before).all()
    assert port.hit is None
    assert "did not answer 'f 0; f 1'" in caplog.text
