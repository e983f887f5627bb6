"""Find the home switches of an arm behind an ODrive, and read them again later.

The switches are the axes' min endstops, closed at home and below. If an enabled switch closes while
its motor is on, the firmware reports an error. They are therefore enabled only to be found or read.
"""

import math

import numpy as np

from sautereau.robot.drivers.odrive.axes import Axes
from sautereau.robot.drivers.odrive.power import AXES, IDLE, SWITCHING
from sautereau.robot.drivers.polling import MARGIN
from sautereau.robot.errors import MotionFault
from sautereau.trajectory.segments import Counts

_HOMING = 11  # state of an axis
_BACK_OFF = 0.02  # rad, off a home switch
_FURTHEST = 0.5  # rad, that a joint may be below its home switch
_SPEEDS = (0.2, 0.05)  # rad/s, to find the switches and to find them exactly
_READING = 0.01  # s, until an enabled switch has been read, debounced


def find_switches(axes: Axes, home: Counts) -> None:
    """Find both home switches, then slowly find them exactly, and move there.

    The motors' turns are 0 there. The joints move one after the other. A joint's motor is off for a
    moment after it has found its switch.

    Args:
        home: Counts of the switches, shape (2,).
    """
    fast, slow = map(axes.limits.in_counts, _SPEEDS)
    off = axes.limits.in_counts(_BACK_OFF)
    for joint in (1, 2):
        _find(axes, joint, fast)
    axes.go(axes.positions() + np.array([off, off]), fast)
    for joint in (1, 2):
        _find(axes, joint, slow)
    axes.go(home, fast)


def switches_closed(axes: Axes) -> list[bool]:
    """Read whether each joint is at its home switch or below, while its motor is off."""
    for joint in (1, 2):
        _enable_switch(axes, joint, True)
    closed = [_closed(axes, joint) for joint in (1, 2)]
    for joint in (1, 2):
        _enable_switch(axes, joint, False)
    axes.switch_on()
    return closed


def _find(axes: Axes, joint: int, speed: float) -> None:
    """Move joint 1 or 2 to its home switch, from above; counts per second."""
    name = AXES[joint - 1]
    _enable_switch(axes, joint, True)
    axes.switch_on()
    _open(axes, joint)
    axes.line.set(
        {f"{name}.controller.config.homing_speed": speed / float(axes.per_turn[joint - 1])}
    )
    axes.line.confirmed(f"w {name}.requested_state {_HOMING}")
    limit = 2 * math.pi * axes.limits.in_counts(1.0) / speed + MARGIN
    axes.polling.until(lambda: axes.line.read(f"{name}.current_state") != _HOMING, "homing", limit)
    axes.check_errors("homing")
    if not axes.line.read(f"{name}.is_homed"):
        raise MotionFault(
            f"homing: joint {joint} stopped before its home switch; check that the arm moves"
            " freely and the switch, then home() again"
        )
    _enable_switch(axes, joint, False)
    axes.switch_on()


def _open(axes: Axes, joint: int) -> None:
    """Move joint 1 or 2 up until it is above its home switch."""
    limits = axes.limits
    up = limits.in_counts(_BACK_OFF) * (np.array([1, 2]) == joint)
    speed, moved = limits.in_counts(_SPEEDS[0]), 0.0
    while _closed(axes, joint):
        if moved > _FURTHEST:
            raise MotionFault(
                f"homing: the home switch of joint {joint} is still closed after {moved:.3g} rad;"
                " check it and its wiring, or move the arm by hand"
            )
        axes.go(axes.positions() + up, speed)
        moved += _BACK_OFF


def _enable_switch(axes: Axes, joint: int, enabled: bool) -> None:
    """Switch joint 1 or 2 off, and enable or disable its home switch."""
    name = AXES[joint - 1]
    axes.line.confirmed(f"w {name}.requested_state {IDLE}")
    axes.polling.until(
        lambda: axes.line.read(f"{name}.current_state") == IDLE, "switching off", SWITCHING
    )
    axes.line.set({f"{name}.min_endstop.config.enabled": int(enabled)})
    axes.polling.sleep(_READING)


def _closed(axes: Axes, joint: int) -> bool:
    return axes.line.read(f"{AXES[joint - 1]}.min_endstop.endstop_state") != 0
