"""The program in the controller: a press, its torques, the watchdog, and the reactions to faults.

Thread 0 runs the watchdog, and the automatic routines interrupt it. Thread 1 runs the press,
thread 2 the torques. Thread 3 checks that no joint stops alone. Every fault ends at `AB 1;MO AB`.
The abort alone switches the motors off, because off-on-error is set, even if the commands after it
fail. The program sends no message: a full port would block it. Its text is in program.dmc; this
file names the variables that the host sets.
"""

import zlib
from pathlib import Path

WATCH = 0  # Thread of the watchdog
PRESS = 1  # Thread of the press
TORQUES = 2  # Thread of the torques
BOTH = 3  # Thread that checks that no joint stops alone
SETTLE = 20  # Duration in ms of the capture after the motion; at TM 1000 at least as many samples
LOOK = 2  # ms between two checks whether a joint has stopped
TICK = "wtick"  # Time between two counts of the watchdog (ms)
LEFT = "wleft"  # Counts until the watchdog trips; the host renews them
SIGN = "wsign"  # The watchdog writes the signature of this program to it at each count
FAULT = "wfault"
"""Error code (TC) of a command that the controller refused its program, or `LIMIT`; 0 for none."""
LIMIT = -1  # A joint has reached a limit; the abort after it overwrites the stop codes
RATE = "rate"  # Logarithm to base 2 of the controller samples between two rows of a capture
PUSHES = "pushn"  # Number of rows of torques; 0 for none
PUSH_EVERY = "pushk"  # Negative number of samples that each row lasts
PUSH = ("pushA", "pushB")  # Arrays of torques, in volts
RESOLUTION = 2  # Resolution of WT (ms), of AT (samples), and of a segment's samples and velocities


def controller_program(trigger_output: int) -> list[str]:
    """Return the program; its watchdog writes its `signature`."""
    return _lines(trigger_output, signature(trigger_output))


def signature(trigger_output: int) -> int:
    """Return a number that no other program writes, exact in the controller's arithmetic."""
    return zlib.crc32("\r".join(_lines(trigger_output, 0)).encode()) >> 8


def _lines(trigger_output: int, sign: int) -> list[str]:
    names = {name: value for name, value in globals().items() if name.isupper()}
    rest = f"HX {PRESS};HX {TORQUES};OF 0,0;RC 0;CB {trigger_output};HX {BOTH}"
    names |= {"stop": "AB 1;MO AB", "rest": rest, "output": trigger_output, "signature": sign}
    text = Path(__file__).with_suffix(".dmc").read_text(encoding="utf-8")
    return [line.format(**names) for line in text.splitlines() if not line.startswith("'")]
