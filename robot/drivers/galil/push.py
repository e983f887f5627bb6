"""Torques over time, as the controller adds them to those of its position loops."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.robot.drivers.galil.program import PUSH, PUSH_EVERY, PUSHES
from sautereau.robot.errors import UnsafeRequest
from sautereau.trajectory.motion import Floats

if TYPE_CHECKING:
    from sautereau.robot.experiment.feedforward import TorqueTable
    from sautereau.trajectory.segments import Segments

LEAST_INTERVAL = 4
"""Controller samples a row, of a program of some lines a row."""
MOST_ROWS = 256


@dataclass(frozen=True)
class Push:
    """Offsets of the two amplifiers' commands, held for an interval each."""

    volts: Floats
    """V, from the start of motion on, in steps that the controller takes; shape (n, 2)."""
    interval: int
    """Controller samples that each row is held."""

    def commands(self) -> list[str]:
        """Return the commands that write it into the controller's arrays."""
        return [
            f"{name}[{row}]={value:.4f}"
            for name, column in zip(PUSH, self.volts.T, strict=True)
            for row, value in enumerate(column)
        ] + [f"{PUSHES}={len(self.volts)}", f"{PUSH_EVERY}={-self.interval}"]


def plan_push(rig: Rig, torque: TorqueTable, motion: Segments) -> Push:
    """Return the offsets that play a table of torques during a motion.

    A row holds what the table says at its middle; outside the table there is no torque.

    Args:
        rig: Its arm and controller say which volts make which torque, and how much is allowed.
        torque: N m of both joints, over s from the start of motion.
        motion: During which it is played.

    Raises:
        UnsafeRequest: Lists everything that is wrong with the table.
    """
    time, torques = np.asarray(torque.time), np.asarray(torque.torques)
    limit, period = rig.arm.torque_limit, rig.controller.sample_period
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
            faults.append(f"it lasts {time[-1]:.4g} s and the motion {duration:.4g} s")
        faults += [
            f"joint {joint} gets {peak:.4g} N m of at most {limit:.4g} N m (arm.torque_limit)"
            for joint, peak in enumerate(np.abs(torques).max(axis=0), 1)
            if peak > limit
        ]
    if faults:
        raise UnsafeRequest(f"load: torque table: {'; '.join(faults)}; make it anew for this press")
    interval = max(LEAST_INTERVAL, -(-motion.total_samples // MOST_ROWS))
    rows = -(-motion.total_samples // interval)
    middles = (np.arange(rows) + 0.5) * interval * period
    volts = [
        np.interp(middles, time, column, left=0.0, right=0.0) * rig.controller.full_torque / limit
        for column in torques.T
    ]
    return Push(np.array(np.round(np.transpose(volts), 4) + 0.0, dtype=np.float64), interval)
