"""Home: the edges of the home switches, or the encoders' next index beyond them.

Find Edge goes backward where the home input reads 1 and forward where it reads 0, so towards
an edge with 0 below it and 1 above, and decelerates behind it. The last approach is always slow
and from the same side. The torque is low, and software limits around the place where the arm
stands end a search that goes the wrong way.
"""

import math
from typing import TYPE_CHECKING

import numpy as np

from sautereau.robot.drivers.galil.dmc import EDGE_FOUND, INDEX_FOUND, halting, profile
from sautereau.robot.drivers.polling import MARGIN
from sautereau.robot.errors import MotionFault
from sautereau.trajectory.segments import Counts

if TYPE_CHECKING:
    from sautereau.robot.drivers.galil.axes import Axes

FAST, SLOW = 0.2, 0.01
"""rad/s, of the search and of the last approach."""
_AXES = "AB"


class Homing:
    """Homing of two axes.

    Args:
        axes: Their motors are on.
    """

    def __init__(self, axes: "Axes"):
        self._axes = axes
        self._rig, self._limits = axes.rig.controller, axes.limits
        self._behind = 1.0 if self._rig.home_approach == "forward" else 0.0
        """Reading of a home input after the last approach."""

    def find(self, home: Counts) -> None:
        """Find home, define the position there, and set the limits of torque and travel.

        Args:
            home: Counts at home, shape (2,).

        Raises:
            MotionFault: A switch or index was not found within `controller.home_travel`, or not
                twice within `controller.home_tolerance`.
        """
        axes, line = self._axes, self._axes.line
        start, reach = axes.positions(), math.ceil(self._limits.in_counts(self._rig.home_travel))
        axes.settings.limit_torque(self._rig.home_torque)
        axes.settings.limit_travel(start - reach, start + reach)
        self._find_edges(_AXES, FAST)
        first, second = self.approach(), self.approach()
        if (apart := np.abs(second - first)).max() > self._rig.home_tolerance:
            raise MotionFault(
                f"homing: the switches were found twice, {apart[0]} and {apart[1]} counts apart,"
                f" and controller.home_tolerance is {self._rig.home_tolerance}; check that the"
                " switches are fixed and clean"
            )
        if self._rig.home_index:
            self._find_indices()
        line.ask(f"DP {home[0]},{home[1]}")
        axes.settle(home)
        axes.settings.limit_travel(self._limits.lower, self._limits.upper)
        axes.settings.limit_torque(1.0)

    def approach(self) -> Counts:
        """Cross the edges slowly, at last in the direction of the rig; return where that ends."""
        self._find_edges(_AXES, SLOW)
        levels = self._axes.line.read("_HMA", "_HMB")
        if wrong := "".join(a for a, at in zip(_AXES, levels, strict=True) if at != self._behind):
            self._find_edges(wrong, SLOW)
        return self._axes.positions()

    def _find_edges(self, which: str, speed: float) -> None:
        self._move(f"FE {which}", which, speed, EDGE_FOUND)

    def _find_indices(self) -> None:
        sign = 1 if self._rig.home_approach == "forward" else -1
        speed = 2 * round(sign * self._limits.in_counts(SLOW) / 2)
        axes = self._axes
        axes.line.ask(f"JG {speed},{speed}", f"HV {abs(speed)},{abs(speed)}")
        self._move(f"FI {_AXES}", _AXES, SLOW, INDEX_FOUND)

    def _move(self, command: str, which: str, speed: float, found: int) -> None:
        axes = self._axes
        if command.startswith("FE"):
            axes.line.ask(*profile(self._limits, self._limits.in_counts(speed)))
            if speed == SLOW:  # so that the edge is crossed by a few counts only
                axes.line.ask(halting(self._limits)[0])
        axes.line.ask(command)
        axes.line.ask(f"BG {which}")
        axes.await_standstill("homing", self._rig.home_travel / speed + MARGIN)
        # A joint that did not take part keeps the code of its own last search.
        axes.check_stop("homing", {found, EDGE_FOUND})
