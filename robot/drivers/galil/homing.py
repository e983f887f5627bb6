"""Home: the edges of the home switches, or the encoders' next index beyond them.

Find Edge moves backward if the home input reads 1 and forward if it reads 0. It thus moves towards
the edge that has 0 below it and 1 above, and decelerates behind it. The last approach is always
slow and from the same side. The torque is low, and software limits around the position of the arm
end a search in the wrong direction.
"""

import math

import numpy as np

from sautereau.robot.drivers.galil.axes import Axes
from sautereau.robot.drivers.galil.dmc import EDGE_FOUND, INDEX_FOUND, halting, profile
from sautereau.robot.drivers.polling import MARGIN
from sautereau.robot.errors import MotionFault
from sautereau.trajectory.segments import Counts

FAST = 0.2  # Speed of the search (rad/s)
SLOW = 0.01  # Speed of the last approach (rad/s)
_AXES = "AB"


def find_switches(axes: Axes, home: Counts) -> None:
    """Find home, define the position there, and set the limits of torque and travel.

    Args:
        home: Counts at home, shape (2,).

    Raises:
        MotionFault: A switch or index was not found within `controller.home_travel`, or not
            twice within `controller.home_tolerance`.
    """
    rig, limits = axes.rig.controller, axes.limits
    start, reach = axes.positions(), math.ceil(limits.in_counts(rig.home_travel))
    axes.settings.limit_torque(rig.home_torque)
    axes.settings.limit_travel(start - reach, start + reach)
    _find_edges(axes, _AXES, FAST)
    first, second = approach(axes), approach(axes)
    if (apart := np.abs(second - first)).max() > rig.home_tolerance:
        raise MotionFault(
            f"homing: the switches were found twice, {apart[0]} and {apart[1]} counts apart,"
            f" and controller.home_tolerance is {rig.home_tolerance}; check that the"
            " switches are fixed and clean"
        )
    if rig.home_index:
        sign = 1 if rig.home_approach == "forward" else -1
        speed = 2 * round(sign * limits.in_counts(SLOW) / 2)
        axes.line.ask(f"JG {speed},{speed}", f"HV {abs(speed)},{abs(speed)}")
        _search(axes, "FI", _AXES, SLOW, INDEX_FOUND)
    axes.line.ask(f"DP {home[0]},{home[1]}")
    axes.settle(home)
    axes.settings.limit_travel(limits.lower, limits.upper)
    axes.settings.limit_torque(1.0)


def approach(axes: Axes) -> Counts:
    """Cross the edges slowly, the last time in the rig's direction; return the final positions."""
    _find_edges(axes, _AXES, SLOW)
    behind = 1.0 if axes.rig.controller.home_approach == "forward" else 0.0
    levels = axes.line.read("_HMA", "_HMB")
    if wrong := "".join(a for a, at in zip(_AXES, levels, strict=True) if at != behind):
        _find_edges(axes, wrong, SLOW)
    return axes.positions()


def _find_edges(axes: Axes, which: str, speed: float) -> None:
    cruise, start, _ = profile(axes.limits, axes.limits.in_counts(speed))
    axes.line.ask(cruise, start, halting(axes.limits)[0])  # stops close behind the edge
    _search(axes, "FE", which, speed, EDGE_FOUND)


def _search(axes: Axes, command: str, which: str, speed: float, found: int) -> None:
    axes.line.ask(f"{command} {which}")
    axes.line.ask(f"BG {which}")
    axes.await_standstill("homing", axes.rig.controller.home_travel / speed + MARGIN)
    # A joint that did not take part keeps the code of its own last search.
    axes.check_stop("homing", {found, EDGE_FOUND})
