"""What the serial line of the emulated controller says, byte by byte."""

import pytest

from sautereau.sim_backend.devices.galil.firmware import GalilFirmware

REVISION = "DMC4020 Rev 1.3a-SIM sautereau stand-in"


@pytest.mark.parametrize(
    ("sent", "answered"),
    [
        ("\x12\x16", f"{REVISION}\r\n:"),
        ("", ":"),
        ("tp", "?"),
        ("TPY", " 0\r\n:"),
        ("TP;FOO", " 0, 0\r\n:?"),
        ("SB 1;XX;SB 2;", ":?"),
        ("SP*=7;SP ?,?", ": 6, 6\r\n:"),
        ("MG (2+3)*-4,$10", "-20.0000 16.0000\r\n:"),
        ('MG "A;B=",1/4', "A;B= 0.2500\r\n:"),
    ],
)
def test_a_line_is_answered(bench, sent, answered):
    assert bench.send(sent) == answered


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("sh", 1), ("#A", 1), ("PVA 1,2,3", 4), ("SB 1,2", 4), ("DL#A", 10),
        ("PVA=.5,1,2", 6), ("MG 1/0", 6), ("PVA=1,2", 39), ("RS 1", 6), ("EO 0,1", 4),
        ("PVA=1,2,3,4", 4), ("PVA=a,2,3", 9), ("PVA=1e3,2,3", 83), ("PVC=1,2,3", 90),
        ("MG speed", 9), ("XQ", 10), ("XQ X", 11), ("SP", 50), ("SP 1,2,3", 90), ("SHC", 90),
        ("MG", 50), ("MG @OUT", 55), ("DM 1X[5]", 57), ("MG _GNX", 58), ("MG _TP", 58),
        ("MG 1)", 59), ("DM X[25000]", 84), ("RD _KPA", 81), ("QU X[]", 82), ("DA X[]", 82),
        ("MG X[0]", 82), ("MG 1__2", 83), ("QD X[]", 82), ('x="SEVENTH"', 52), ("~a=2", 6),
        ("PR~b=1", 9), ("MG ~b", 9), ("MG @REAL[$7F800000]", 6), ("PW 123456789,123456789", 52),
        ("\x0c\x0b,2", 137), ("SP 1;" + "TP;" * 30, 5),
    ],
)  # fmt: skip
def test_refusals_leave_their_code(bench, line, code):
    assert bench.refusal(line) == code
    assert bench.send("TC1") == "0\r\n:"


def test_arrays_are_bounded(bench):
    bench.accept("DM X[10],longname[2]")
    assert bench.refusal("QU longname[]") == 57
    bench.accept("DA longname[]")
    assert bench.refusal("DM X[10]") == 57
    assert bench.refusal("QU X[],0,10") == 56
    assert bench.refusal("RD _TPA;RC 1") == 81
    for number in range(29):
        bench.accept(f"DM A{number}[1]")
    assert bench.refusal("DM B[1]") == 67


def test_echo_is_on_at_power_up_and_line_feeds_are_ignored(bench):
    firmware = GalilFirmware(bench, on_output=lambda number, level: None)
    assert firmware.receive(b"TP\r\n") == b"TP\r 0, 0\r\n:"
    assert firmware.receive(b"EO 0\r") == b"EO 0\r:"
    assert firmware.receive(b"\nTP\n\r") == b" 0, 0\r\n:"
    assert firmware.receive(b"T") == b""
    assert firmware.receive(b"P") == b""
    assert firmware.receive(b"\r") == b" 0, 0\r\n:"


def test_outputs_report_only_changes(bench):
    bench.accept("SB 3", "SB 3", "CB 1", "CB 3", "OP 129")
    assert bench.outputs == [(0, 3, True), (0, 3, False), (0, 1, True), (0, 8, True)]
