"""The controller's arrays: torques that it adds to a motion, and its record of the motion."""

from dataclasses import dataclass

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.robot.controller import Capture, TorqueTable
from sautereau.robot.drivers.galil.dmc import PUSH, PUSH_EVERY, PUSHES, RESOLUTION, SETTLE
from sautereau.robot.drivers.galil.line import Line
from sautereau.robot.errors import SettingNotTaken, UnsafeRequest
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Segments

LEAST_INTERVAL = 4  # Controller samples of a row; the program needs a few lines for each row
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
class Push:
    """Offsets of the two amplifiers' commands, each held for an interval."""

    volts: Floats
    """V, from the start of motion on, in steps that the controller takes; shape (n, 2)."""
    interval: int
    """Controller samples that each row is held."""


def plan_push(rig: Rig, torque: TorqueTable, motion: Segments, volts: float) -> Push:
    """Return the offsets that play a table of torques during a motion.

    A row holds the table's value at the middle of the row; outside the table the torque is 0.

    Args:
        torque: N m of both joints, over s from the start of motion.
        motion: The motion during which it is played.
        volts: V, the limit of the torque that the controller has taken.

    Raises:
        UnsafeRequest: Lists every fault of the table.
    """
    time, torques = np.asarray(torque.time), np.asarray(torque.torques)
    per_volt, period = (
        rig.arm.torque_limit / rig.controller.full_torque,
        rig.controller.sample_period,
    )
    limit = volts * per_volt
    duration = motion.total_samples * period
    faults = []
    if time.ndim != 1 or torques.shape != (len(time), 2) or len(time) < 2:
        faults.append(f"times {time.shape} and torques {torques.shape} are not (n,) and (n, 2)")
    elif not (np.isfinite(time).all() and np.isfinite(torques).all()):
        faults.append("not every number is finite")
    else:
        if (np.diff(time) <= 0).any() or time[0] < 0:
            faults.append("the times do not increase from 0 s or later")
        if time[-1] > duration + period:
            faults.append(f"it lasts {time[-1]:.4g} s, longer than the motion, {duration:.4g} s")
        faults += [
            f"joint {joint} gets {peak:.4g} N m, above {limit:.4g} N m, the smaller one of"
            " arm.torque_limit and the limit of the amplifiers"
            for joint, peak in enumerate(np.abs(torques).max(axis=0), 1)
            if peak > limit
        ]
    if faults:
        raise UnsafeRequest(
            f"load: torque table: {'; '.join(faults)}; make a new one for this press"
        )
    steps = -(-motion.total_samples // (256 * RESOLUTION))  # At most 256 rows
    interval = max(LEAST_INTERVAL, steps * RESOLUTION)
    rows = -(-motion.total_samples // interval)
    middles = (np.arange(rows) + 0.5) * interval * period
    offsets = [
        np.interp(middles, time, column, left=0.0, right=0.0) / per_volt for column in torques.T
    ]
    return Push(np.array(np.round(np.transpose(offsets), 4) + 0.0, dtype=np.float64), interval)


def write_push(line: Line, push: Push | None) -> None:
    """Write the offsets to the controller and read them back; None writes no offsets."""
    if push is None:
        line.ask(f"{PUSHES}=0")
        line.verify({PUSHES: 0})
        return
    rows = len(push.volts)
    arrays = [
        f"{name}[{row}]={value:.4f}"
        for name, column in zip(PUSH, push.volts.T, strict=True)
        for row, value in enumerate(column)
    ]
    line.ask_packed([*arrays, f"{PUSHES}={rows}", f"{PUSH_EVERY}={-push.interval}"])
    line.verify({PUSHES: rows, PUSH_EVERY: -push.interval})
    held = np.column_stack([line.upload(name, rows) for name in PUSH])
    if (wrong := np.abs(held - push.volts).max()) > 1e-4:  # V, the arrays' resolution
        raise SettingNotTaken(
            f"controller on {line.name}: a torque that it holds differs by {wrong:.4g} V from"
            " what was sent; load() again, and check the cable's shield"
        )


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
