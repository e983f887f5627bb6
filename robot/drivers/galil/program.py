"""The program in the controller: a press, its torques, the watchdog, and fault handling.

Thread 0 runs the watchdog, and ``#POSERR`` after a following error; thread 1 the press;
thread 2 the torques; thread 3 stops both joints where one of them stops alone. Variables that
the host sets are named here.
"""

WATCH, PRESS, TORQUES, BOTH = 0, 1, 2, 3
"""Threads."""
SETTLE = 20
"""ms that the capture continues after the motion; at TM 1000 at least as many samples."""
LOOK = 2
"""ms between two checks whether one joint has stopped alone; the other is then stopped too."""
TICK, LEFT = "wtick", "wleft"
"""ms between two counts of the watchdog, and the counts left; the host renews the latter."""
RATE = "rate"
"""Logarithm to base 2 of the controller samples between two rows of a capture."""
PUSHES, PUSH_EVERY = "pushn", "pushk"
"""Rows of torques, 0 for none, and the negative of the samples that each row lasts."""
PUSH = ("pushA", "pushB")
"""Arrays of torques, in volts."""


def controller_program(trigger_output: int) -> list[str]:
    """Return the program; its capture, trigger and motion start in one sample."""
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
        # A limit's stop codes are 2 and 3; without one both joints end in the same sample.
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
