"""Ports of the emulated controller: TCP handles, unsolicited messages, a line that takes time."""

import socket
import time

import pytest
import serial

from sautereau.rig.load import load_rig, with_values
from sautereau.sim_backend.bench import Bench, StandIn
from sautereau.sim_backend.devices.emulators import EMULATORS, emulator_of
from sautereau.sim_backend.devices.galil.firmware import GalilFirmware
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.fault_tables import Faults
from sautereau.sim_backend.parts import ControllerUnit
from sautereau.sim_backend.scene import parse_scene
from tests.presses import MUTE_TEXT
from tests.sim_backend.scenes import MUTE, scene_of

HELLO = b'DL\r#A\rWT 4\rMG "hello"\rEN\r\\\r'
ETHERNET = ControllerUnit(interface="ethernet")


def quiet(unit=None):
    return scene_of("ideal", **MUTE, step=1e-3, controller=unit)


def connected(stand_in):
    host, port = stand_in.serial_port.removeprefix("tcp://").split(":")
    return socket.create_connection((host, int(port)), timeout=60)


def ask(line, text, end=b":"):
    line.sendall(text)
    return until(line, end)


def until(line, end):
    answer = b""
    while not answer.endswith(end):
        got = line.recv(4096)
        assert got, answer
        answer += got
    return answer


def test_tcp_never_echoes_and_messages_go_where_cf_says():
    with StandIn(load_rig(), quiet(ETHERNET)) as stand_in:
        assert stand_in.rig.controller.port == stand_in.serial_port
        with connected(stand_in) as first, connected(stand_in) as second:
            assert ask(first, b"TP\r") == b" 0, 0\r\n:"
            assert ask(second, b"WH;MG _WH,_CF\r") == b"IHB\r\n: 1.0000 83.0000\r\n:"
            assert ask(first, b"EO 0\r", b"?") == b"?"
            assert ask(first, HELLO) == b"::"[:1]
            assert ask(second, b"CFI\r") == b":"
            assert ask(first, b"XQ #A\r") == b":"
            assert until(second, b"\n") == b"hello\r\n"
            assert ask(second, b"CW 1\r") == b":"
            assert ask(first, b"XQ #A\r") == b":"
            marked = until(second, b"\x8a")
            assert bytes(byte & 127 for byte in marked) == b"hello\r\n"
            assert ask(first, b"MG _WH\r") == b" 0.0000\r\n:"
        with connected(stand_in) as third:
            assert ask(third, b"TC1\r").endswith(b":")
            third.sendall(b"RS\r")
            assert third.recv(100) == b""  # a reset loses all connections


def test_a_lost_handle_is_noticed_with_the_next_message(bench):
    firmware = bench.firmware
    first, second = firmware.connect(), firmware.connect()
    assert (first, second) == ("A", "B")
    program = b'#A\rWT 2\rMG "x"\rJP #A\r#TCPERR\rlost=_IA4;code=_TC;HX 1\rRE\r\\'
    firmware.receive(b"DL\r" + program, first)
    assert firmware.receive(b"lost=-9;CFI;XQ #A,1\r", second) == b":::"
    bench.tick(6)
    assert firmware.receive(b"", second).startswith(b"x\r\n")
    firmware.disconnect(second)
    bench.tick(6)
    assert firmware.receive(b"MG lost,code,_XQ1\r", first) == b" 1.0000 123.0000 -1.0000\r\n:"
    assert [bench.number(f"_IA{n}") for n in range(6)] == [2130706433, 250, 7, -1, 1, -1]
    assert [firmware.connect() for _ in range(8)] == [*"BCDEFGH", None]


def test_a_silent_cable_is_noticed_by_messages_without_acknowledgement():
    program = b'#A\rWT 100\rMG "x"\rEN\r#TCPERR\rMO\rRE\r'
    sent = b"DL\r" + program + b"\\CFI;SH;XQ #A\r"
    faults = Faults.model_validate({"cable_out": {"after_bytes": len(sent)}})
    bench = Bench(load_rig(), quiet(ETHERNET).model_copy(update={"faults": faults}))
    assert bench.connect(5000) == "A"
    assert bench.receive(sent, "A") == b""
    for _ in range(1300):
        bench.tick()
    assert bench.firmware.motors_on == (True, True)
    for _ in range(100):
        bench.tick()
    assert bench.firmware.motors_on == (False, False)
    assert not bench.connected("A")


def transmitted(bench, data, limit=5000):
    """What comes back over a line that takes time, and the samples until its end."""
    bench.firmware.receive(data)
    answer, start = b"", bench.firmware.samples
    while bench.firmware.moving:
        bench.tick()
        answer += b"".join(bench.firmware.outgoing().values())
        assert bench.firmware.samples < start + limit
    return answer, bench.firmware.samples - start


@pytest.mark.parametrize("baud", [9600, 115_200])
def test_characters_take_their_time(make_bench, baud):
    bench = make_bench(ControllerUnit(baud_rate=baud))
    transmitted(bench, b"")
    period = 1000 / 1024e3
    _, samples = transmitted(bench, b"DM x[100]\r")
    assert samples * period == pytest.approx(11 * 10 / baud, abs=3 * period)
    answer, samples = transmitted(bench, b"QU x[],0,99,1\r")
    assert len(answer) == 100 * 8 - 1 + 6
    assert samples * period == pytest.approx((14 + len(answer)) * 10 / baud, abs=3 * period)
    text = "\r".join(["DL", "#A", *["NO " + "x" * 70] * 20, "EN", "\\"])
    answer, samples = transmitted(bench, text.encode())
    assert answer == b":"
    assert samples * period == pytest.approx(len(text) * 10 / baud, abs=3 * period)


def test_a_watchdog_expires_while_a_slow_line_is_busy(make_bench):
    bench = make_bench(ControllerUnit(baud_rate=9600), host_waits=True)
    transmitted(bench, b"DL\r#W\rWT 100\rleft=left-1\rJP #W,left>0\rMO\rEN\r\\")
    transmitted(bench, b"DM x[60];left=3;SH;XQ #W\r")
    assert bench.firmware.motors_on == (True, True)
    transmitted(bench, b"QU x[],0,59,1\r")  # 0.5 s
    assert bench.firmware.motors_on == (False, False)


def test_an_input_buffer_overflows_while_parameters_are_burned(make_bench):
    bench = make_bench(ControllerUnit(baud_rate=115_200, input_buffer=60))
    transmitted(bench, b"")
    answer, samples = transmitted(bench, b"BN\r" + b"TP\r" * 40)
    assert samples > 1000
    assert answer.count(b"0, 0") < 25
    assert transmitted(bench, b"TC1\r")[0].endswith(b"5 Input buffer full\r\n:")


@pytest.mark.parametrize(
    ("unit", "echoes"),
    [
        (ControllerUnit(), True),
        (ControllerUnit(interface="usb"), True),
        (ControllerUnit(interface="usb", usb_echo=False), False),
        (ControllerUnit(burned=("MO", "EO 0")), False),
    ],
)
def test_echo_at_power_up(bench, unit, echoes):
    firmware = GalilFirmware(bench, unit, on_output=lambda number, level: None)
    assert firmware.receive(b"TP\r") == (b"TP\r" if echoes else b"") + b" 0, 0\r\n:"


SCENE = f"""{MUTE_TEXT}[controller]
model = "DMC4123"
firmware = "1.3b-FAST"
burned_program = "#AUTO\\nEN"
output_delay = "50 us"
"""


def test_a_scene_describes_the_controller():
    unit = parse_scene(SCENE).controller
    assert unit is not None
    assert (unit.galil.family, unit.burned) == ("4103", ("MO",))
    assert unit.output_delay == pytest.approx(50e-6)
    wrong = SCENE.replace("4123", "9999").replace("-FAST", "?") + 'interface = "wifi"\necho = 1\n'
    with pytest.raises(SceneError) as caught:
        parse_scene(wrong)
    for name in ("model", "firmware", "interface", "echo"):
        assert f"controller.{name}" in str(caught.value)
    odrive = with_values(load_rig(), {"controller.kind": "odrive"})
    with pytest.raises(SceneError, match="takes no such table"):
        StandIn(odrive, quiet(ETHERNET))


def test_an_emulator_of_another_package_gets_the_scenes_table_if_it_takes_it(monkeypatch):
    monkeypatch.setattr(EMULATORS, "get", lambda kind: lambda rig, unit=None: (rig, unit))
    assert emulator_of("toy", unit="table")("rig") == ("rig", "table")
    assert emulator_of("toy")("rig") == ("rig", None)


def test_real_time_pacing_carries_characters_at_the_line_s_rate():
    unit = ControllerUnit(baud_rate=9600)
    with (
        StandIn(load_rig(), quiet(unit), paced=True) as stand_in,
        serial.serial_for_url(stand_in.serial_port, timeout=60) as line,
    ):
        line.write(b"EO 0\r")
        assert line.read_until(b":") == b"EO 0\r:"
        start = time.monotonic()
        line.write(b'MG "' + b"x" * 70 + b'"\r')
        assert len(line.read_until(b":")) == 73
        assert time.monotonic() - start > 148 * 10 / 9600
