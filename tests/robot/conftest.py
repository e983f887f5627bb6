"""A controller written down as the lines it is sent and the bytes it answers."""

import contextlib
import os
import threading
import tty
from types import SimpleNamespace

import numpy as np
import pytest

from rig.load import load_rig, with_values
from robot.galil import GalilController
from trajectory.segments import Segments

REVISION = "DMC4020 Rev 1.3c-SIM"
CONNECT = [
    ("EO 0", "EO 0\r\n:"),
    ("\x12\x16", f"{REVISION}\r\n:"),
    ("MG _PVA", " 255.0000\r\n:"),
    ("TM 1000", ":"),
    ("MG _TM", " 1000.0000\r\n:"),
    ("ER 20000,20000;OE 1,1", "::"),
    ("MG _ERA,_ERB,_OEA,_OEB", " 20000.0000 20000.0000 1.0000 1.0000\r\n:"),
]
ON = [("SH AB", ":"), ("MG _MOA,_MOB", " 0.0000 0.0000\r\n:")]
HOME = [
    ("FL 2147483647,2147483647;BL -2147483648,-2147483648", "::"),
    ("SP 63660,63660;AC 635904,635904;DC 635904,635904", ":::"),
    ("HM AB;BG AB", "::"),
    ("MG _BGA,_BGB", " 1.0000 1.0000\r\n:"),
    ("MG _BGA,_BGB", " 0.0000 0.0000\r\n:"),
    ("MG _SCA,_SCB", " 10.0000 10.0000\r\n:"),
    ("DP 0,-500000", ":"),
    ("MG _TPA,_TPB", " 1.0000 -499999.0000\r\n:"),
    ("FL 444444,-55556;BL -444444,-833333", "::"),
    ("MG _FLA,_FLB,_BLA,_BLB", " 444444.0000 -55556.0000 -444444.0000 -833333.0000\r\n:"),
]
MOVE = [
    ("MG _TPA,_TPB", " 0.0000 -500000.0000\r\n:"),
    ("SP 100000,100000;AC 999424,999424;DC 999424,999424", ":::"),
    ("PA 1000,-501000;BG AB", "::"),
    ("MG _BGA,_BGB", " 0.0000 1.0000\r\n:"),
    ("MG _BGA,_BGB", " 0.0000 0.0000\r\n:"),
    ("MG _SCA,_SCB", " 1.0000 1.0000\r\n:"),
    ("MG _TPA,_TPB", " 900.0000 -500900.0000\r\n:"),
    ("MG _TPA,_TPB", " 1003.0000 -501002.0000\r\n:"),
]
LOAD = [
    ("MG _PVA,_PVB", " 255.0000 255.0000\r\n:"),
    ("PVA=10,2000,10;PVB=-5,-1000,10;PVA=30,2000,16;PVB=-15,-1000,16;PVA=10,0,10", ":::::"),
    ("PVB=-5,0,10;PVA=0,0,0;PVB=0,0,0", ":::"),
    ("MG _PVA,_PVB", " 252.0000 252.0000\r\n:"),
]
ROWS = 27
ARM = [
    ("MG _TPA,_TPB", " 1003.0000 -501002.0000\r\n:"),
    ("DA *[]", ":"),
    (f"DM XA[{ROWS}],XB[{ROWS}]", ":"),
    ("RA XA[],XB[]", ":"),
    ("RD _TPA,_TPB", ":"),
    ("DL", ""),
    ("#PRESS", ""),
    ("RC 1;SB 1;BT AB", ""),
    ("AM AB", ""),
    ("WT 20", ""),
    ("RC 0", ""),
    ("CB 1", ""),
    ("EN", ""),
    ("\\", "::"),
    ("MG 4711", " 4711.0000\r\n:"),
]
START = [("XQ #PRESS", ":")]
POLL = "MG _BTA,_BGA,_BGB,_XQ"
WAIT = [
    (POLL, " 0.0000 1.0000 1.0000 2.0000\r\n:"),
    (POLL, " 3.0000 0.0000 0.0000 3.0000\r\n:"),
    (POLL, " 3.0000 0.0000 0.0000 -1.0000\r\n:"),
    ("MG _SCA,_SCB", " 31.0000 31.0000\r\n:"),
    ("MG _BTA,_BTB", " 3.0000 3.0000\r\n:"),
]
CAPTURE = [
    (f"QU XA[],0,{ROWS - 1},1", ", ".join(f"{1000 + i}.0000" for i in range(ROWS)) + "\r\n:"),
    (f"QU XB[],0,{ROWS - 1},1", ", ".join(f"{-501000 - i}.0000" for i in range(ROWS)) + "\r\n:"),
]
STOP = [("ST AB", ":"), ("MG _BGA,_BGB", " 0.0000 0.0000\r\n:")]
ABORT = [
    ("AB", ":"),
    ("MO AB", ":"),
    ("CB 1", ":"),
    ("MG _MOA,_MOB,_BGA,_BGB", " 1.0000 1.0000 0.0000 0.0000\r\n:"),
]
OFF = [*STOP, *ABORT]
PRESS = [
    *CONNECT, *ON, *HOME, *MOVE, *LOAD, *ARM, *START, *WAIT, *CAPTURE, *OFF,
]  # fmt: skip


class Transcript:
    """A serial port that expects exactly these lines; an answer may be an error to raise."""

    def __init__(self, pairs):
        self.expected = list(pairs)
        self.incoming = b""
        self.partial = b""
        self.fault = None
        self.closed = False

    def open(self, name, baud_rate, timeout):
        return self

    @property
    def in_waiting(self):
        return len(self.incoming)

    def read(self, size=1):
        if self.fault is not None:
            raise self.fault
        data, self.incoming = self.incoming[:size], self.incoming[size:]
        return data

    def write(self, data):
        self.partial += data
        while b"\r" in self.partial:
            line, self.partial = self.partial.split(b"\r", 1)
            assert self.expected, f"sent {line!r}, nothing more was expected"
            sent, answer = self.expected.pop(0)
            assert line == sent.encode()
            if isinstance(answer, BaseException):
                self.fault = answer
            else:
                self.fault = None
                self.incoming += answer if isinstance(answer, bytes) else answer.encode()

    def reset_input_buffer(self):
        self.incoming = b""

    def close(self):
        self.closed = True

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
        partial = b""
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
                    os.write(self.master, answer if isinstance(answer, bytes) else answer.encode())

    def close(self):
        if self.slave is not None:
            os.write(self.slave, b"END\r")
        self.thread.join(timeout=5)
        if self.slave is not None:
            os.close(self.slave)
            os.close(self.master)
        assert not self.thread.is_alive()


@pytest.fixture(scope="session")
def rig():
    return with_values(load_rig("paper"), {"controller.timeout": "0.2 s"})


@pytest.fixture
def bench(rig):
    """Return a function that makes a controller over a transcript; all of it must be used."""
    made = []

    def make(*parts):
        transcript = Transcript([pair for part in parts for pair in part])
        time = Time()
        controller = GalilController(
            rig, open_port=transcript.open, clock=time.clock, sleep=time.sleep
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
        return GalilController(with_values(rig, {"controller.port": end.port})), end

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
