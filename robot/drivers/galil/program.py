"""The program in the controller: a press, its torques, the watchdog, and the last net.

The watchdog has thread 0, where the controller runs ``#POSERR`` as well, the press thread 1,
the torques thread 2, and thread 3 sees to it that no joint goes on alone. Variables that the
host sets are named here.
"""

from dataclasses import dataclass

from sautereau.robot.errors import UnsafeRequest

WATCH, PRESS, TORQUES, BOTH = 0, 1, 2, 3
"""Threads."""
SETTLE = 20
"""ms that the capture runs on after the motion; at TM 1000 no fewer controller samples."""
LOOK = 2
"""ms between two looks whether one joint has stopped alone; the other is then stopped too."""
TICK, LEFT = "wtick", "wleft"
"""ms between two counts of the watchdog, and the counts left; the host renews the latter."""
RATE = "rate"
"""Logarithm to base 2 of the controller samples between two rows of a capture."""
PUSHES, PUSH_EVERY = "pushn", "pushk"
"""Rows of torques, 0 for none, and the samples that each lasts, negative."""
PUSH = ("pushA", "pushB")
"""Arrays of torques, in volts."""
SOURCES = {
    "posA": "_TPA",
    "posB": "_TPB",
    "errA": "_TEA",
    "errB": "_TEB",
    "trqA": "_TTA",
    "trqB": "_TTB",
}
"""What a capture records, by array."""
_EXPONENTS = range(1, 9)


def controller_program(trigger_output: int) -> list[str]:
    """Return the program; in it capture, trigger and motion begin in one sample."""
    safe = f"AB 1;MO AB;HX {PRESS};HX {TORQUES};OF 0,0;CB {trigger_output}"
    return [
        "#WATCH",
        f"WT {TICK}",
        f"{LEFT}={LEFT}-1",
        f"JP #WATCH,{LEFT}>0",
        safe,
        "EN",
        "#PRESS",
        f"JP #BARE,{PUSHES}=0",
        f"XQ #PUSH,{TORQUES}",
        "#BARE",
        f"RC {RATE};SB {trigger_output};BT AB",
        f"XQ #BOTH,{BOTH}",
        "AM AB",
        f"HX {TORQUES};OF 0,0",
        f"WT {SETTLE}",
        "RC 0",
        f"CB {trigger_output}",
        "EN",
        "#BOTH",
        f"WT {LOOK}",
        # A limit's stop codes are 2 and 3; without one they come to their ends in one sample.
        "JP #BOTH,_BGA*_BGB*(_SCA-2)*(_SCA-3)*(_SCB-2)*(_SCB-3)<>0",
        "JP #EVEN,_BGA+_BGB=0",
        f"ST AB;HX {TORQUES};OF 0,0",
        "AM AB",
        "MO AB",
        "#EVEN",
        "EN",
        "#PUSH",
        "AT 0",
        "row=0",
        "#NEXT",
        f"OF {PUSH[0]}[row],{PUSH[1]}[row]",
        "row=row+1",
        f"AT {PUSH_EVERY},1",
        f"JP #NEXT,row<{PUSHES}",
        "OF 0,0",
        "EN",
        "#POSERR",
        safe,
        "RE 1",
    ]


@dataclass(frozen=True)
class CapturePlan:
    """How the controller records a motion."""

    rows: int
    """Of each array."""
    exponent: int
    """Operand of RC: a row every 2^exponent controller samples."""

    @property
    def interval(self) -> int:
        """Controller samples between two rows."""
        return 2**self.exponent


def plan_capture(total_samples: int, room: int) -> CapturePlan:
    """Return the finest capture of a motion for which the controller has room.

    It sees the whole motion, and is full for certain before the program stops it.

    Args:
        total_samples: Controller samples of the motion.
        room: Array elements that are free.

    Raises:
        UnsafeRequest: There is no room for the coarsest.
    """
    for exponent in _EXPONENTS:
        interval = 2**exponent
        rows = (total_samples + SETTLE - 2 * interval) // interval + 1
        if rows >= 1 and rows * len(SOURCES) <= room:
            return CapturePlan(rows, exponent)
    raise UnsafeRequest(
        f"load: a capture of {total_samples} samples does not fit into {room} array elements,"
        " however coarse; make a shorter motion, or let no other program keep arrays"
    )


def array_commands(capture: CapturePlan, pushes: int) -> list[str]:
    """Return the commands that make room for a capture and for rows of torques."""
    sizes = [f"{name}[{capture.rows}]" for name in SOURCES]
    return [
        *([f"DM {PUSH[0]}[{pushes}],{PUSH[1]}[{pushes}]"] if pushes else []),
        f"DM {','.join(sizes[:3])}",
        f"DM {','.join(sizes[3:])}",
    ]


def record_commands() -> list[str]:
    """Return the commands that choose what a capture records, and where."""
    return [f"RA {','.join(f'{name}[]' for name in SOURCES)}", f"RD {','.join(SOURCES.values())}"]
