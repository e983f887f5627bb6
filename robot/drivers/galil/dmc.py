"""A press in the words of Galil's DMC language."""

from collections.abc import Sequence

import numpy as np

from sautereau.trajectory.segments import Counts, Segments

END_OF_MOTION = ("PVA=0,0,0", "PVB=0,0,0")
"""Ends PVT mode after the segments before it."""
CLEAR_SEGMENTS = ("PVA=0,0,-1", "PVB=0,0,-1")
"""Empties the FIFO of both axes."""
NORMAL_ENDS = frozenset({0, 1, 31})
"""Stop codes of a move or a PVT motion that came to its end."""
HOMED_ENDS = NORMAL_ENDS | {10}
"""Stop codes of an axis that has found its home switch."""
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
    """Say what a stop code (`_SCA`) means."""
    return f"{_STOP_CODES.get(int(code), 'unknown stop code')} (stop code {code:g})"


def segment_commands(segments: Segments) -> list[str]:
    """Write segments as `PVA=p,v,t` and `PVB=p,v,t`, in turn.

    p is in counts from the end of the segment before, v in counts a second at its end,
    t in controller samples.
    """
    return [
        f"PV{axis}={step},{velocity},{samples}"
        for steps, velocities, samples in zip(
            segments.steps, segments.velocities, segments.samples, strict=True
        )
        for axis, step, velocity in zip("AB", steps, velocities, strict=True)
    ]


def segments_from(commands: Sequence[str], start: Counts) -> Segments:
    """Read back what `segment_commands` wrote; ``start`` is in counts, shape (2,)."""
    numbers = np.array(
        [[int(word) for word in command.partition("=")[2].split(",")] for command in commands],
        dtype=np.int64,
    ).reshape(-1, 2, 3)
    return Segments(
        start=np.array(start, dtype=np.int64),
        steps=numbers[:, :, 0],
        velocities=numbers[:, :, 1],
        samples=numbers[:, 0, 2],
    )
