"""Limits, profiles and segments as commands of Galil's DMC language."""

from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np

from sautereau.rig.schema import Controller
from sautereau.robot.drivers.galil.program import RESOLUTION
from sautereau.robot.drivers.limits import Limits
from sautereau.robot.errors import UnsafeRequest
from sautereau.trajectory.segments import Segments

LONGEST_LINE = 79  # Characters of one command line, without its carriage return
END_OF_MOTION = ("PVA=0,0,0", "PVB=0,0,0")  # Ends PVT mode after the segments before it
CLEAR_SEGMENTS = ("PVA=0,0,-1", "PVB=0,0,-1")  # Empties the FIFO of both axes
NORMAL_ENDS = frozenset({0, 1, 31})  # Stop codes of a move or a PVT motion that came to its end
EDGE_FOUND = 9  # Stop code of an axis that has found the edge of its home switch
INDEX_FOUND = 10  # Stop code of an axis that has found an index
LARGEST_STEP = 30_000_000  # Largest step of a segment (counts)
LARGEST_VELOCITY = 15_000_000  # Largest velocity of a segment (counts per second)
LONGEST_SEGMENT = 2048  # Longest segment (controller samples)
_STEP_OF_ACCELERATION = 1024  # counts/s^2, resolution of AC and DC
_LARGEST_ACCELERATION = 1_073_740_800  # counts/s^2
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
    steps = int(min(acceleration, _LARGEST_ACCELERATION)) // _STEP_OF_ACCELERATION
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
            ("a step", np.abs(segments.steps).max(), LARGEST_STEP, "counts"),
            ("a velocity", np.abs(segments.velocities).max(), LARGEST_VELOCITY, "counts/s"),
            ("a segment", segments.samples.max(), LONGEST_SEGMENT, "samples"),
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
