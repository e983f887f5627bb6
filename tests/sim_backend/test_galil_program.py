"""Programs, capture, and the trigger edge of the emulated controller."""

import math

import numpy as np
import pytest

from sautereau.sim_backend.devices.galil.tasks import LINE_TIME
from sautereau.sim_backend.parts import ControllerUnit


def capture(bench, *sources, exponent=1, size=100):
    names = [f"D{number}[]" for number in range(len(sources))]
    bench.accept(
        "DM " + ",".join(name.replace("]", f"{size}]") for name in names),
        "RA " + ",".join(names),
        "RD " + ",".join(sources),
    )


def upload(bench, name, comma=True):
    answer = bench.send(f"QU {name}[]" + (",0,99,1" if comma else ""))
    assert answer.endswith("\r\n\x1a\r\n:")
    return [float(text) for text in answer[:-6].split("," if comma else "\r")]


def test_a_press_triggers_captures_and_starts_with_the_next_sample(bench):
    bench.accept("SH")
    for axis, sign in (("A", 1), ("B", -1)):
        for part in (f"{sign * 500},{sign * 9000},60", f"{sign * 500},0,60", "0,0,0"):
            bench.accept(f"PV{axis}={part}")
    capture(bench, "_TPA", "_TPB", "_TEA")
    assert bench.load("#PRESS", "WT 5", "RC 1;SB 1;BT AB", "AM", "CB 1", "EN") == ":"
    bench.accept("XQ #PRESS")
    assert bench.number("_XQ") == 0
    bench.run()
    (up, number, level), (down, _, _) = bench.outputs
    assert (number, level) == (1, True)
    path = np.array(bench.positions)
    # The edge is in the sample after which the reference leaves rest.
    first = int(np.argmax(path[:, -1, 0] != 0))
    assert first == up + 1
    assert path[first, 0, 0] == 0
    assert down == first + 119
    assert bench.send("MG _XQ;SC") == "-1.0000\r\n: 31, 31\r\n:"
    # Record k is the encoder 2 k samples after the start.
    at_edge = np.round(path[first : first + 200 : 2, 0, :])
    assert upload(bench, "D0") == list(at_edge[:, 0])
    assert upload(bench, "D1", comma=False) == list(at_edge[:, 1])
    assert not any(upload(bench, "D2"))
    assert bench.counts == [1000, -1000]


def test_capture_stops_when_full_or_stopped_and_records_every_power_of_two(bench):
    bench.accept("SH", "JGA=8192", "BGA")
    capture(bench, "_RPA")
    bench.accept("RC 3,5")
    assert bench.send("MG _RC,_RD") == " 1.0000 0.0000\r\n:"
    assert bench.refusal("RC 1") == 80
    assert bench.refusal("DA *[]") == 80
    bench.tick(33)
    assert bench.send("MG _RC,_RD") == " 0.0000 5.0000\r\n:"
    path = np.array(bench.positions)[:, 0, 0]
    assert upload(bench, "D0")[:5] == list(np.round(path[0:33:8]))
    bench.accept("RC 1,-10")
    bench.tick(50)
    assert bench.number("_RC") == 1
    bench.accept("AB")
    assert not bench.firmware.moving, "a circular record never ends"
    bench.accept("RC 0", "RC 3,5")
    assert bench.firmware.moving
    bench.accept("RC 0")
    assert not bench.firmware.moving
    assert bench.refusal("RC 1,101") == 84


def test_lines_take_their_time_and_a_line_goes_in_one_go(bench):
    lines = [f"SB {n % 4 + 1};CB {n % 4 + 1}" for n in range(40)]
    bench.load("#A;SB 8", *lines, "NO a comment; SB 7", "' another", "EN")
    bench.accept("XQ #A")
    assert bench.outputs == []
    assert bench.run() == math.ceil(44 * LINE_TIME * 1024)
    assert len(bench.outputs) == 82
    times = [at for at, _, _ in bench.outputs[1:-1]]
    assert times[::2] == times[1::2]


def test_a_faster_sample_has_time_for_fewer_lines(bench):
    bench.accept("TM 250")
    bench.load("#A", *["NO"] * 42, "EN")
    bench.accept("XQ #A")
    assert bench.run() == pytest.approx(44 * LINE_TIME * 4096, abs=1)


def test_a_trip_point_releases_the_rest_of_its_line(bench):
    bench.accept("SH", "PVA=100,0,10;PVA=,,0")
    bench.load("#WAIT", "AI -2;SB 1;BTA", "AM;CB 1;EN")
    bench.accept("XQ #WAIT,3")
    bench.tick(20)
    assert bench.outputs == []
    assert bench.send("MG _XQ3,_XQ0,_HX3") == " 1.0000 -1.0000 2.0000\r\n:"
    bench.firmware.inputs[1] = False
    bench.run()
    assert bench.outputs == [(20, 1, True), (30, 1, False)]  # it moves from 21 to 30


def test_a_program_that_does_not_end_is_an_error(bench):
    assert bench.load("#A", "SB 1") == ":"
    bench.accept("XQ #A")
    bench.run()
    assert bench.firmware.receive(b"").startswith(b"?")
    assert bench.send("TC1").startswith("10 ")


@pytest.mark.parametrize("end", ["\\", "\\\r", "\\\r\n"])
def test_download_answers_once(bench, end):
    assert bench.load("#A", "EN", end=end) == ":"
    assert bench.send("LS") == "0 #A \r\n1 EN \r\n:"


@pytest.mark.parametrize(
    ("lines", "code"),
    [
        (["#A", "#A"], 61),
        (["#TOOLONGNAME"], 61),
        (["M" * 81], 60),
        (["EN"] * 4001, 60),
        ([f"#A{number}" for number in range(511)], 62),
    ],
)
def test_a_bad_download_leaves_no_program(bench, lines, code):
    assert bench.load(*lines) == "?"
    assert bench.send("TC1").startswith(f"{code} ")
    assert bench.refusal("XQ") == 10


def test_torque_is_recorded_as_a_fraction_of_ten_volts(bench):
    bench.torques = 10.0, -2.5
    capture(bench, "_TTA", "_TTB", "_TSA", "TIME")
    bench.accept("RC 1,4")
    bench.tick(9)
    assert upload(bench, "D0")[:4] == [32_767] * 4
    assert upload(bench, "D1")[:4] == [-8192] * 4
    assert upload(bench, "D2")[0] == 12  # bits 0 to 4 only
    assert np.diff(upload(bench, "D3")[:4]).tolist() == [2, 2, 2]
    assert bench.send("TT;MG _TTB") == " 10.0000,-2.5000\r\n:-2.5000\r\n:"


def test_elements_are_uploaded_in_pieces(make_bench):
    bench = make_bench(ControllerUnit(control_z="attached"))
    bench.accept("DM X[4]", "X[2]=7")
    assert bench.send("QU X[],2,3,1") == " 7.0000, 0.0000\x1a\r\n:"
    assert bench.refusal("QU X[],3,3,1") == 56  # at least two
    assert bench.refusal("QU X[],0,4,1") == 56


def test_waits_have_a_resolution_of_two_and_scale_with_tm(bench):
    bench.load("#A", "t=TIME;WT 9;a=TIME-t", "t=TIME;WT 9,1;b=TIME-t", "EN")
    for period, first in ((1000, 8), (500, 16)):
        bench.accept(f"TM {period}", "XQ #A")
        bench.run()
        assert bench.send("MG a,b") == f" {first}.0000 8.0000\r\n:"


def test_at_may_be_late(make_bench):
    bench = make_bench(ControllerUnit(at_jitter=4))
    bench.load("#A", "AT 0", "#L", "AT -10,1;SB 1;CB 1;n=n+1", "JP #L,n<40", "EN")
    bench.accept("n=0", "XQ #A")
    bench.tick(450)
    rises = np.array([at for at, _, level in bench.outputs if level])
    late = rises - rises[0] - 10 * np.arange(40)
    assert 0 < np.ptp(late) <= 4


@pytest.mark.parametrize(
    ("amplifier", "largest"), [("none", 9.9982), ("D3040", 7), ("D3540", 5), ("D3640", 5)]
)
def test_the_largest_gain_limits_the_torque(make_bench, amplifier, largest):
    bench = make_bench(ControllerUnit(amplifier=amplifier))
    bench.accept("TL 9.9" if amplifier != "D3640" else "TL 5", "AG 2")
    assert bench.number("_TLA") == pytest.approx(min(9.9, largest), abs=1e-3)
    if amplifier != "none":
        assert bench.refusal(f"TLA={largest + 0.1:.2f}") == 6
        bench.accept(f"TLA={largest}")
    bench.accept("SHA")
    assert bench.refusal("AGA=1") == 135
