"""A controller written down as the lines it is sent and the bytes it answers."""

import contextlib
import os
import threading
import tty
from types import SimpleNamespace

import numpy as np
import pytest

from sautereau.rig.load import load_rig, with_values
from sautereau.robot.drivers.galil.dmc import LONGEST_LINE, controller_program, pack, signature
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.trajectory.segments import Segments
from tests.emulated import ScriptedPort
from tests.robot.motions import no_keep_alive

FRESH = [("", ":"), ("MG 4711", " 4711.0000\r\n:")]
"""What a line sends before a question is repeated, and its answers."""
REVISION = "DMC4020 Rev 1.3c-SIM"
STATE = "MG 4711,_MOA,_MOB,_BGA,_BGB,_OFA,_OFB"
ABORT = [
    ("AB", ":"),
    ("MO AB", ":"),
    ("HX 1;HX 2;HX 3;OF 0,0;RC 0;CB 1", "::::::"),
    (STATE, " 4711.0000 1.0000 1.0000 0.0000 0.0000 0.0000 0.0000\r\n:"),
]
PROGRAM = controller_program(1)
SIGN = signature(1)
SOFTWARE = [
    ("FL 444444,-55556;BL -444444,-833333", "::"),
    ("MG _FLA,_FLB,_BLA,_BLB", " 444444.0000 -55556.0000 -444444.0000 -833333.0000\r\n:"),
]


def torque(volts, lost):
    return [
        ("OV 0,0", ":"),
        (f"TL {volts},{volts}", ":"),
        ("MG _TLA,_TLB", f" {volts} {volts}\r\n:"),
        (f"OV {lost},{lost}", ":"),
        ("MG _OVA,_OVB", f" {lost} {lost}\r\n:"),
    ]


def read(values):
    """Return the questions for operands, as many as a line holds, and the answers."""
    found = iter(values.values())
    return [
        (f"MG {','.join(names)}", "".join(f" {next(found):.4f}" for _ in names) + "\r\n:")
        for names in pack(values, LONGEST_LINE - 3)
    ]


def both(**values):
    """Return the operands of both axes with a value."""
    return {f"_{name}{axis}": value for name, value in values.items() for axis in "AB"}


GAINS = both(MT=1, CE=0, AG=1, KP=6, KI=0.5, KD=64, FA=0, FV=0, IL=9.9982)
MEMORY = [*read(GAINS), ("MG _BN,_BWA,_BWB", " 4711.0000 0.0000 0.0000\r\n:")]
SETTINGS = [
    ("TM 1000", ":"),
    ("OE 3,3;OF 0,0;TK 0,0", ":::"),
    ("CN -1,-1,,0,1", ":"),
    ("LD 0,0;DC 63661056,63661056;SD 63661056,63661056", ":::"),
    *torque("9.9980", "5.9988"),
    ("OT 102,102;OA 1,1", "::"),
    ("MG _TM,_OEA,_OEB", " 1000.0000 3.0000 3.0000\r\n:"),
    ("MG _OFA,_OFB,_TKA,_TKB", " 0.0000 0.0000 0.0000 0.0000\r\n:"),
    ("MG _CN0,_CN1,_CN3,_CN4,_LDA,_LDB", " -1.0000 -1.0000 0.0000 1.0000 0.0000 0.0000\r\n:"),
    ("MG _OTA,_OTB,_OAA,_OAB", " 102.0000 102.0000 1.0000 1.0000\r\n:"),
    ("ER 20000,20000", ":"),
    ("MG _ERA,_ERB", " 20000.0000 20000.0000\r\n:"),
    *SOFTWARE,
]
SET = {
    **GAINS,
    **both(TL=9.998, OV=5.9988),
    "_TM": 1000,
    **both(OE=3, OF=0, TK=0),
    **{"_CN0": -1, "_CN1": -1, "_CN3": 0, "_CN4": 1},
    **both(LD=0, OT=102, OA=1, ER=20000),
    **{"_FLA": 444444, "_FLB": -55556, "_BLA": -444444, "_BLB": -833333},
}
STATE_BEFORE = "MG _MOA,_MOB,_AB,wsign,TIME,_SCA,_SCB,_XQ0,wleft,wfault"
ON_AND_WATCHED = (
    STATE_BEFORE,
    f" 0.0000 0.0000 1.0000 {SIGN}.0000 5001.0000 1.0000 1.0000 1.0000 9.0000 0.0000\r\n:",
)
READY = [ON_AND_WATCHED, *read(SET)]
DOWNLOAD = [
    ("DL", ""),
    *[(line, b"") for line in PROGRAM],
    ("\\", b"::"),
    ("MG 4711", " 4711.0000\r\n:"),
    ("LS", "".join(f"{number} {line} \r\n" for number, line in enumerate(PROGRAM)) + ":"),
]
REST_OF_CONNECT = [*ABORT, *MEMORY, *SETTINGS, *DOWNLOAD]
CONNECT = [
    ("EO 0", "EO 0\r\n:"),
    ("\x12\x16", f"{REVISION}\r\n:"),
    ("EO 1", ":"),
    ("MG _EO", " 1.0000\r\n:"),
    ("CF I;CW 1", "::"),
    *REST_OF_CONNECT,
]
ON = [
    ("MG _AB,_LFA,_LFB,_LRA,_LRB", " 1.0000 1.0000 1.0000 1.0000 1.0000\r\n:"),
    ("wtick=50;wleft=10;wsign=0;wfault=0", "::::"),
    ("MG wtick,wleft", " 50.0000 10.0000\r\n:"),
    ("XQ #WATCH,0", ":"),
    ("MG wleft,_XQ0", " 10.0000 1.0000\r\n:"),
    ("MG wleft,_XQ0", " 9.0000 1.0000\r\n:"),
    ("MG TIME", " 5000.0000\r\n:"),
    (
        "MG wsign,wleft,_XQ0,TIME;wsign=0;wleft=10*(wleft>0)",
        f" {SIGN}.0000 9.0000 1.0000 5001.0000\r\n:::",
    ),
    ("SH AB", ":"),
    ("MG _MOA,_MOB", " 0.0000 0.0000\r\n:"),
]
CODES = "MG _SCA,_SCB,_XQ0,wleft,wfault"
AT_REST = ("MG _BGA,_BGB", " 0.0000 0.0000\r\n:")
EDGES = (CODES, " 9.0000 9.0000 1.0000 9.0000 0.0000\r\n:")
BOTH_EDGES = [("FE AB", ":"), ("BG AB", ":"), AT_REST, EDGES]
SLOWLY = ("SP 3182,3182;AC 31744,31744;DC 63661056,63661056", ":::")
APPROACH = [
    SLOWLY,
    *BOTH_EDGES,
    ("MG _HMA,_HMB", " 1.0000 0.0000\r\n:"),  # joint 2 came from above
    SLOWLY,
    ("FE B", ":"),
    ("BG B", ":"),
    AT_REST,
    EDGES,
    ("MG _TPA,_TPB", " 1.0000 -499999.0000\r\n:"),
]
HOME = [
    *READY,
    ("MG _TPA,_TPB", " 7.0000 9.0000\r\n:"),
    *torque("4.9990", "2.9994"),
    ("FL 1018599,1018601;BL -1018585,-1018583", "::"),
    ("MG _FLA,_FLB,_BLA,_BLB", " 1018599.0000 1018601.0000 -1018585.0000 -1018583.0000\r\n:"),
    ("SP 63660,63660;AC 635904,635904;DC 63661056,63661056", ":::"),
    ("FE AB", ":"),
    ("BG AB", ":"),
    ("MG _BGA,_BGB", " 1.0000 1.0000\r\n:"),
    AT_REST,
    EDGES,
    *APPROACH,
    *APPROACH,
    ("DP 0,-500000", ":"),
    ("MG _TPA,_TPB", " 1.0000 -499999.0000\r\n:"),
    *SOFTWARE,
    *torque("9.9980", "5.9988"),
]
MOVE = [
    *READY,
    ("MG _TPA,_TPB", " 0.0000 -500000.0000\r\n:"),
    ("SP 100000,100000;AC 999424,999424;DC 999424,999424", ":::"),
    ("PA 1000,-501000", ":"),
    ("BG AB", ":"),
    ("MG _BGA,_BGB", " 0.0000 1.0000\r\n:"),
    ("MG _BGA,_BGB", " 0.0000 0.0000\r\n:"),
    (CODES, " 1.0000 1.0000 1.0000 9.0000 0.0000\r\n:"),
    ("MG _TPA,_TPB", " 900.0000 -500900.0000\r\n:"),
    ("MG _TPA,_TPB", " 1003.0000 -501002.0000\r\n:"),
]
ROWS = 27
FIFO = [
    ("MG _PVA,_PVB", " 255.0000 255.0000\r\n:"),
    ("PVA=10,2000,10;PVB=-5,-1000,10;PVA=30,2000,16;PVB=-15,-1000,16;PVA=10,0,10", ":::::"),
    ("PVB=-5,0,10;PVA=0,0,0;PVB=0,0,0", ":::"),
    ("MG _PVA,_PVB", " 252.0000 252.0000\r\n:"),
]
ARRAYS = [
    ("DA *[]", ":"),
    ("MG _DM", " 16000.0000\r\n:"),
    (f"DM posA[{ROWS}],posB[{ROWS}],errA[{ROWS}]", ":"),
    (f"DM errB[{ROWS}],trqA[{ROWS}],trqB[{ROWS}]", ":"),
]
LOAD = [*FIFO, *ARRAYS, ("pushn=0", ":"), ("MG pushn", " 0.0000\r\n:")]
ARM = [
    *READY,
    ("MG _TPA,_TPB", " 1003.0000 -501002.0000\r\n:"),
    ("DC 63661056,63661056;SD 63661056,63661056", "::"),
    ("RA posA[],posB[],errA[],errB[],trqA[],trqB[]", ":"),
    ("RD _TPA,_TPB,_TEA,_TEB,_TTA,_TTB", ":"),
    ("rate=1", ":"),
    ("MG rate,_XQ1", " 1.0000 -1.0000\r\n:"),
]
START = [("XQ #PRESS,1", ":")]
POLL = "MG _BGA,_BGB,_SCA,_SCB,_XQ1,_XQ0"
WAIT = [
    (POLL, " 1.0000 1.0000 0.0000 0.0000 11.0000 1.0000\r\n:"),
    (POLL, " 0.0000 0.0000 0.0000 0.0000 13.0000 1.0000\r\n:"),
    (POLL, " 0.0000 0.0000 0.0000 0.0000 -1.0000 1.0000\r\n:"),
    (CODES, " 31.0000 31.0000 1.0000 9.0000 0.0000\r\n:"),
    ("MG _BTA,_BTB,_RPA,_RPB", " 3.0000 3.0000 1050.0000 -501025.0000\r\n:"),
]


def upload(name, numbers):
    listed = ", ".join(f"{number:.4f}" for number in numbers)
    return f"QU {name}[],0,{ROWS - 1},1", f" {listed}\r\n\x1a:"


CAPTURE = [
    upload("posA", range(1000, 1000 + ROWS)),
    upload("posB", range(-501000, -501000 - ROWS, -1)),
    upload("errA", range(ROWS)),
    upload("errB", range(0, -ROWS, -1)),
    upload("trqA", [16380] * ROWS),
    upload("trqB", [-32760] * ROWS),
]
STOP = [
    ("ST AB", ":"),
    ("HX 1;HX 2;HX 3;OF 0,0;RC 0;CB 1", "::::::"),
    ("MG _BGA,_BGB", " 0.0000 0.0000\r\n:"),
]
OFF = [*STOP, *ABORT]
HOMED = [*CONNECT, *ON, *HOME]
STARTED = [*HOMED, *MOVE, *LOAD, *ARM, *START]
PRESS = [*STARTED, *WAIT, *CAPTURE, *OFF]


class Echo:
    """What the controller says of what it hears; bytes as an answer stand for all that it says."""

    def __init__(self):
        self.on = False

    def answer(self, sent, answer):
        echoed = self.on
        if sent.startswith("EO"):
            self.on = sent == "EO 1"
        if isinstance(answer, bytes):
            return answer
        return f"{sent}\r\n{answer}".encode() if echoed and answer else answer.encode()


class Transcript(ScriptedPort):
    """A serial port that expects exactly these lines; an answer may be an error to raise."""

    def __init__(self, pairs):
        super().__init__()
        self.expected = list(pairs)
        self.echo = Echo()
        self.partial = b""

    def write(self, data):
        self.partial += data
        while b"\r" in self.partial:
            line, self.partial = self.partial.split(b"\r", 1)
            assert self.expected, f"sent {line!r}, nothing more was expected"
            sent, answer = self.expected.pop(0)
            assert line == sent.encode()
            self.fault = answer if isinstance(answer, BaseException) else None
            if self.fault is None:
                self.incoming += self.echo.answer(sent, answer)

    def check(self):
        assert not self.expected, f"never asked: {self.expected}"


class Time:
    """A clock that only sleeping moves."""

    def __init__(self):
        self.now = 0.0

    def clock(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds


class Terminal:
    """A controller at the other end of a pseudo-terminal; answer None hangs up."""

    def __init__(self, pairs):
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        self.port = os.ttyname(self.slave)
        self.expected = list(pairs)
        self.wrong = []
        self.thread = threading.Thread(target=self._serve, daemon=True)
        self.thread.start()

    def _serve(self):
        partial, echo = b"", Echo()
        with contextlib.suppress(OSError):
            while data := os.read(self.master, 4096):
                partial += data
                while b"\r" in partial:
                    line, partial = partial.split(b"\r", 1)
                    if line == b"END":
                        return
                    sent, answer = self.expected.pop(0) if self.expected else ("nothing", "?")
                    if line != sent.encode():
                        self.wrong.append((sent, line))
                    if answer is None:
                        os.close(self.slave)
                        os.close(self.master)
                        self.slave = None
                        return
                    os.write(self.master, echo.answer(sent, answer))

    def close(self):
        if self.slave is not None:
            os.write(self.slave, b"END\r")
        self.thread.join(timeout=60)
        if self.slave is not None:
            os.close(self.slave)
            os.close(self.master)
        assert not self.thread.is_alive()


@pytest.fixture(scope="session")
def rig():
    return with_values(load_rig("paper"), {"controller.timeout": "0.2 s"})


@pytest.fixture(scope="session")
def odrive_rig():
    kind = {"controller.kind": "odrive", "controller.baud_rate": 921600}
    return with_values(load_rig(), kind | {"controller.timeout": "0.2 s"})


@pytest.fixture
def transcript_of():
    return Transcript


@pytest.fixture
def bench(rig):
    """Return a function that makes a controller over a transcript; all of it must be used."""
    made = []

    def make(*parts):
        transcript = Transcript([pair for part in parts for pair in part])
        time = Time()
        controller = GalilController(
            rig,
            open_port=transcript.open,
            clock=time.clock,
            sleep=time.sleep,
            keep_alive=no_keep_alive,
        )
        made.append(transcript)
        return controller, transcript

    yield make
    for transcript in made:
        transcript.check()


@pytest.fixture
def terminal(rig):
    """Return a function that makes a controller on a real pseudo-terminal."""
    made = []

    def make(*parts):
        end = Terminal([pair for part in parts for pair in part])
        made.append(end)
        at = with_values(rig, {"controller.port": end.port})
        return GalilController(at, keep_alive=no_keep_alive), end

    yield make
    for end in made:
        end.close()
        assert not end.wrong
        assert not end.expected


@pytest.fixture
def segments():
    return Segments(
        start=np.array([1000, -501000]),
        steps=np.array([[10, -5], [30, -15], [10, -5]]),
        velocities=np.array([[2000, -1000], [2000, -1000], [0, 0]]),
        samples=np.array([10, 16, 10]),
    )


@pytest.fixture
def lines():
    """Return the parts of a press as (sent, answered) pairs, by name."""
    return SimpleNamespace(
        **{
            name.lower(): pairs
            for name, pairs in globals().items()
            if name.isupper() and isinstance(pairs, list)
        }
    )
