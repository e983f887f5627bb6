"""Feed-forward torques, as offsets that the controller adds to its amplifiers' commands."""

from dataclasses import dataclass

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.robot.controller import TorqueTable
from sautereau.robot.drivers.galil.line import Line
from sautereau.robot.drivers.galil.program import PUSH, PUSH_EVERY, PUSHES, RESOLUTION
from sautereau.robot.errors import SettingNotTaken, UnsafeRequest
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Segments

LEAST_INTERVAL = 4  # Controller samples of a row; the program needs a few lines for each row
MOST_ROWS = 256
_VOLTAGE_STEP = 1e-4  # V, resolution of the arrays


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
    steps = -(-motion.total_samples // (MOST_ROWS * RESOLUTION))
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
    if (wrong := np.abs(held - push.volts).max()) > _VOLTAGE_STEP:
        raise SettingNotTaken(
            f"controller on {line.name}: a torque that it holds differs by {wrong:.4g} V from"
            " what was sent; load() again, and check the cable's shield"
        )
