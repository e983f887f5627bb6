"""Galil's DMC language: the program in the controller; limits, profiles, segments as commands.

Thread 0 of the program runs the watchdog, and the automatic routines interrupt it. Thread 1 runs
the press, thread 2 the torques. Thread 3 checks that no joint stops alone. Every fault ends at `AB
1;MO AB`. The abort alone switches the motors off, because off-on-error is set, even if the commands
after it fail. The program sends no message: a full port would block it. Its text is in program.dmc;
this file names the variables that the host sets.
"""

import zlib
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

from sautereau.rig.schema import Controller
from sautereau.robot.drivers.limits import Limits
from sautereau.robot.errors import UnsafeRequest
from sautereau.trajectory.segments import Segments

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
    text = Path(__file__).with_name("program.dmc").read_text(encoding="utf-8")
    return [line.format(**names) for line in text.splitlines() if not line.startswith("'")]


LONGEST_LINE = 79  # Characters of one command line, without its carriage return
END_OF_MOTION = ("PVA=0,0,0", "PVB=0,0,0")  # Ends PVT mode after the segments before it
CLEAR_SEGMENTS = ("PVA=0,0,-1", "PVB=0,0,-1")  # Empties the FIFO of both axes
NORMAL_ENDS = frozenset({0, 1, 31})  # Stop codes of a move or a PVT motion that came to its end
EDGE_FOUND = 9  # Stop code of an axis that has found the edge of its home switch
INDEX_FOUND = 10  # Stop code of an axis that has found an index
_STEP_OF_ACCELERATION = 1024  # counts/s^2, resolution of AC and DC
CAUSES = frozenset({2, 3, 6, 8, 11, 12, 15})
"""Stop codes of all causes that switch the motors off, except the watchdog."""
_STOP_CODES = {
    0: "running, or never moved",
    1: "at the commanded position",
    2: "stopped by the forward limit",
    3: "stopped by the reverse limit",
    4: "stopped by ST",
    6: "stopped by the abort input",
    7: "stopped by AB",
    8: "switched off by a following error over ER",
    9: "stopped after finding an edge",
    10: "stopped after homing",
    11: "stopped by the selective abort input",
    12: "stopped by an encoder failure",
    15: "stopped by an amplifier fault",
    30: "running in PVT mode",
    31: "at the end of a PVT motion",
    32: "left PVT mode on an empty FIFO",
    99: "timed out on its way",
}


def stop_reason(code: float) -> str:
    """Return the meaning of a stop code (`_SCA`)."""
    return f"{_STOP_CODES.get(int(code), 'unknown stop code')} (stop code {code:g})"


def profile(limits: Limits, speed: float) -> tuple[str, str, str]:
    """Return SP, AC and DC for a move at ``speed`` counts per second.

    The controller takes even speeds and multiples of 1024 counts/s^2: both are
    rounded down, but not below the smallest value that it takes.
    """
    even = max(RESOLUTION, int(speed) // RESOLUTION * RESOLUTION)
    rate = _rate(limits.move_acceleration(speed))
    return f"SP {even},{even}", f"AC {rate},{rate}", f"DC {rate},{rate}"


def halting(limits: Limits) -> tuple[str, str]:
    """Return DC and SD for a stop by ST or by a limit, at the arm's limit of acceleration.

    They are set at a standstill: DC is not taken during a move.
    """
    rate = _rate(limits.acceleration)
    return f"DC {rate},{rate}", f"SD {rate},{rate}"


def _rate(acceleration: float) -> int:
    steps = int(min(acceleration, 1_073_740_800)) // _STEP_OF_ACCELERATION  # The largest
    return max(1, steps) * _STEP_OF_ACCELERATION


def switch_settings(controller: Controller) -> dict[str, float]:
    """Return the configuration of limit and home switches, as CN and LD read back."""
    disabled = 3 if controller.limit_switches == "none" else 0
    return {
        "_CN0": 1 if controller.limit_switches == "active_high" else -1,
        "_CN1": -1 if controller.home_grounded == "below" else 1,
        "_CN3": 0,  # no input stops a single axis
        "_CN4": 1,  # the abort input leaves the watchdog running
        "_LDA": disabled,
        "_LDB": disabled,
    }


def check_segments(segments: Segments) -> None:
    """Refuse segments that are out of the controller's ranges or off its steps.

    Raises:
        UnsafeRequest: Lists every fault.
    """
    faults = [
        f"{what} of {value:g} {unit}, and the controller takes {limit:g} at most"
        for what, value, limit, unit in (
            ("a step", np.abs(segments.steps).max(), 30_000_000, "counts"),
            ("a velocity", np.abs(segments.velocities).max(), 15_000_000, "counts/s"),
            ("a segment", segments.samples.max(), 2048, "samples"),
        )
        if value > limit
    ]
    for what, values in (("velocities", segments.velocities), ("samples", segments.samples)):
        if odd := int(np.count_nonzero(values % RESOLUTION)):
            faults.append(f"{odd} of its {what} are odd, and the controller takes even ones")
    if faults:
        raise UnsafeRequest(f"load: {'; '.join(faults)}; plan the motion again")


def segment_commands(segments: Segments) -> list[str]:
    """Write segments as `PVA=p,v,t` and `PVB=p,v,t`, in turn.

    p is in counts from the end of the previous segment, v in counts per second at its end,
    t in controller samples.
    """
    return [
        f"PV{axis}={step},{velocity},{samples}"
        for steps, velocities, samples in zip(
            segments.steps, segments.velocities, segments.samples, strict=True
        )
        for axis, step, velocity in zip("AB", steps, velocities, strict=True)
    ]


def pack(commands: Iterable[str], longest: int = LONGEST_LINE) -> Iterator[tuple[str, ...]]:
    """Group commands so that each group, joined by `;`, has at most so many characters."""
    line: list[str] = []
    for command in commands:
        if line and len(";".join([*line, command])) > longest:
            yield tuple(line)
            line = []
        line.append(command)
    if line:
        yield tuple(line)


def pieces(rows: int, longest: int) -> Iterator[tuple[int, int]]:
    """Divide rows from 0 into pieces of at least 2, as QU needs; yield the first and last row."""
    count = max(1, min(-(-rows // longest), rows // 2))
    edges = [rows * i // count for i in range(count + 1)]
    return ((first, end - 1) for first, end in pairwise(edges))
