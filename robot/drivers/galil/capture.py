"""Plan how the controller records a motion, and read the record."""

from dataclasses import dataclass

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.robot.controller import Capture
from sautereau.robot.drivers.galil.line import Line
from sautereau.robot.drivers.galil.program import PUSH, SETTLE
from sautereau.robot.errors import UnsafeRequest

SOURCES = {
    "posA": "_TPA",
    "posB": "_TPB",
    "errA": "_TEA",
    "errB": "_TEB",
    "trqA": "_TTA",
    "trqB": "_TTB",
}
"""What a capture records, by array."""
VOLTS_RECORDED = 10 / 32767
"""V of a recorded torque of 1: the record holds integers, unlike the operand _TT."""
EXPONENTS = range(1, 9)  # Operands of RC


@dataclass(frozen=True)
class CapturePlan:
    """How the controller records a motion."""

    rows: int
    """Number of rows of each array."""
    exponent: int
    """Operand of RC: a row every 2^exponent controller samples."""


def plan_capture(total_samples: int, room: int) -> CapturePlan:
    """Return the finest capture of a motion for which the controller has room.

    It covers the complete motion, and its arrays are full before the program stops it.

    Args:
        total_samples: Controller samples of the motion.
        room: Array elements that are free.

    Raises:
        UnsafeRequest: There is no room for the coarsest.
    """
    for exponent in EXPONENTS:
        interval = 2**exponent
        rows = (total_samples + SETTLE - 2 * interval) // interval + 1
        if rows >= 2 and rows * len(SOURCES) <= room:
            return CapturePlan(rows, exponent)
    raise UnsafeRequest(
        f"load: a capture of {total_samples} samples does not fit into {room} array elements,"
        " however coarse; make a shorter motion, or let no other program keep arrays"
    )


def make_room(line: Line, total_samples: int, torque_rows: int) -> CapturePlan:
    """Allocate the arrays of a capture and of rows of torques; return the plan of the capture."""
    line.ask("DA *[]")
    (room,) = line.read("_DM")
    plan = plan_capture(total_samples, int(room) - torque_rows * len(PUSH))
    if torque_rows:
        line.ask(f"DM {','.join(f'{name}[{torque_rows}]' for name in PUSH)}")
    sizes = [f"{name}[{plan.rows}]" for name in SOURCES]
    line.ask(f"DM {','.join(sizes[:3])}")
    line.ask(f"DM {','.join(sizes[3:])}")
    return plan


def read_capture(line: Line, plan: CapturePlan, rig: Rig) -> Capture:
    """Read the controller's record."""
    columns = {name: line.upload(name, plan.rows) for name in SOURCES}
    pairs = {
        name: np.column_stack([columns[f"{name}A"], columns[f"{name}B"]])
        for name in ("pos", "err", "trq")
    }
    return Capture(
        samples=2**plan.exponent * np.arange(plan.rows, dtype=np.int64),
        counts=np.rint(pairs["pos"]).astype(np.int64),
        following_errors=np.rint(pairs["err"]).astype(np.int64),
        torques=pairs["trq"] * (VOLTS_RECORDED * rig.arm.torque_limit / rig.controller.full_torque),
        sample_period=rig.controller.sample_period,
        trigger_delay=rig.controller.trigger_delay,
        start_std=rig.controller.trigger_delay_std,
    )
