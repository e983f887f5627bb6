"""Find the home switches of an arm behind an ODrive, and see whether they are still there.

They are the axes' min endstops, closed at home and below. A switch that closes while it is
watched and its motor is on counts as an error, so they are watched only while they are sought.
"""

import math

import numpy as np

from sautereau.robot.drivers.joint_axes import MARGIN
from sautereau.robot.drivers.limits import Limits
from sautereau.robot.drivers.odrive.axes import OdriveAxes
from sautereau.robot.drivers.odrive.errors import check_errors
from sautereau.robot.drivers.odrive.power import IDLE, SWITCHING
from sautereau.robot.drivers.odrive.settings import AXES
from sautereau.robot.errors import MotionFault
from sautereau.trajectory.segments import Counts

_HOMING = 11  # state of an axis
_BACK_OFF = 0.02  # rad, off a home switch
_FURTHEST = 0.5  # rad, that a joint may stand below its home switch
_SPEEDS = (0.2, 0.05)  # rad/s, to find the switches and to find them exactly
_READING = 0.01  # s, until a switch that is watched has been read


def find_switches(axes: OdriveAxes, limits: Limits, home: Counts) -> None:
    """Find both home switches, then, slowly, find them exactly, and stand there.

    There the motors' turns are 0. One joint goes after the other, and is limp for a moment
    when it has found its switch.

    Args:
        axes: With power.
        limits: Of the arm.
        home: Counts, of the switches; shape (2,).
    """
    fast, slow = map(limits.in_counts, _SPEEDS)
    off, most, tolerance = limits.in_counts(_BACK_OFF), limits.acceleration, limits.tolerance
    for joint in (1, 2):
        _find(axes, limits, joint, fast)
    axes.go(axes.positions() + np.array([off, off]), fast, most, tolerance)
    for joint in (1, 2):
        _find(axes, limits, joint, slow)
    axes.go(home, fast, most, tolerance)


def switches_closed(axes: OdriveAxes) -> list[bool]:
    """Read whether each joint is at its home switch or below; its motor is off meanwhile."""
    for joint in (1, 2):
        _watch(axes, joint, True)
    closed = [_closed(axes, joint) for joint in (1, 2)]
    for joint in (1, 2):
        _watch(axes, joint, False)
    axes.switch_on()
    return closed


def _find(axes: OdriveAxes, limits: Limits, joint: int, speed: float) -> None:
    """Move joint 1 or 2 to its home switch, from above; counts a second."""
    name = AXES[joint - 1]
    _watch(axes, joint, True)
    axes.switch_on()
    _open(axes, limits, joint)
    axes.line.set({f"{name}.controller.config.homing_speed": axes.in_turns(joint, speed)})
    axes.line.tell(f"w {name}.requested_state {_HOMING}")
    patience = 2 * math.pi * limits.in_counts(1.0) / speed + MARGIN
    axes.await_(lambda: axes.line.read(f"{name}.current_state") != _HOMING, "homing", patience)
    check_errors(axes.line, "homing")
    if not axes.line.read(f"{name}.is_homed"):
        raise MotionFault(
            f"homing: joint {joint} stopped before its home switch; check that the arm moves"
            " freely and the switch, then home() again"
        )
    _watch(axes, joint, False)
    axes.switch_on()


def _open(axes: OdriveAxes, limits: Limits, joint: int) -> None:
    """Move joint 1 or 2 up until it is above its home switch."""
    up = limits.in_counts(_BACK_OFF) * (np.array([1, 2]) == joint)
    speed, gone = limits.in_counts(_SPEEDS[0]), 0.0
    while _closed(axes, joint):
        if gone > _FURTHEST:
            raise MotionFault(
                f"homing: the home switch of joint {joint} is still closed {gone:.3g} rad on;"
                " check it and its wiring, or move the arm by hand"
            )
        axes.go(axes.positions() + up, speed, limits.acceleration, limits.tolerance)
        gone += _BACK_OFF


def _watch(axes: OdriveAxes, joint: int, watched: bool) -> None:
    """Switch joint 1 or 2 off, and watch its home switch, or not, from now on."""
    name = AXES[joint - 1]
    axes.line.tell(f"w {name}.requested_state {IDLE}")
    axes.await_(lambda: axes.line.read(f"{name}.current_state") == IDLE, "switching off", SWITCHING)
    axes.line.set({f"{name}.min_endstop.config.enabled": int(watched)})
    axes.sleep(_READING)


def _closed(axes: OdriveAxes, joint: int) -> bool:
    return axes.line.read(f"{AXES[joint - 1]}.min_endstop.endstop_state") != 0
