"""The arm behind a Galil DMC-4x: what it is told to home, move and stop.

Positions are counts, speeds counts a second.
"""

import math

import numpy as np

from sautereau.robot.drivers.arm import Arm
from sautereau.robot.drivers.galil.axes import Axes
from sautereau.robot.drivers.galil.dmc import HOMED_ENDS, NORMAL_ENDS
from sautereau.robot.drivers.galil.handshake import introduce, set_limits, verify
from sautereau.robot.drivers.galil.line import Line
from sautereau.robot.drivers.galil.program import controller_program
from sautereau.robot.drivers.joint_axes import MARGIN
from sautereau.trajectory.segments import Counts

_HOMING_SPEED = 0.2  # rad/s
_NO_LIMITS = ("FL 2147483647,2147483647", "BL -2147483648,-2147483648")


class GalilArm(Arm[Line, Axes]):
    """Two joints that can be powered, homed and moved; arguments as for `ConnectedArm`."""

    _line = Line
    _WITHOUT_HOST = (
        "A motion that the controller has begun goes on until its watchdog strikes, {period:g} s"
        " after the host's last sign of life."
    )

    def _set_up(self, line: Line) -> tuple[str, Axes]:
        identity = introduce(line, self._settings)
        output = self._settings.trigger_output
        axes = Axes(line, output, self._limits.halting, self._clock, self._sleep)
        axes.abort()
        set_limits(line, self._rig, self._limits)
        line.download(controller_program(output))
        return identity, axes

    def _switch_on(self, axes: Axes) -> None:
        axes.switch_on(self._settings.watchdog_period)

    def _halt(self, axes: Axes) -> None:
        axes.stop()

    def _find_home(self, axes: Axes, home: Counts) -> None:
        line = axes.line
        # Until the switches are found, positions mean nothing, and so do their limits.
        line.ask(*_NO_LIMITS)
        line.ask(*self._limits.profile(self._limits.in_counts(_HOMING_SPEED)))
        line.ask("HM AB")
        line.ask("BG AB")
        axes.await_standing("homing", 2 * math.pi / _HOMING_SPEED + MARGIN)
        axes.check_stop("homing", HOMED_ENDS)
        line.ask(f"DP {home[0]},{home[1]}")
        axes.settle(home, self._limits.tolerance)
        line.ask(*self._limits.software())
        verify(line, self._limits.software_settings())

    def _home_levels(self, axes: Axes) -> list[float]:
        return axes.line.read("_HMA", "_HMB")

    def _go(self, axes: Axes, target: Counts, speed: float) -> None:
        distance = int(np.abs(target - axes.positions()).max())
        axes.line.ask(*self._limits.profile(speed))
        axes.line.ask(f"PA {target[0]},{target[1]}")
        axes.line.ask("BG AB")
        axes.await_standing("the move", distance / speed + MARGIN)
        axes.check_stop("the move", NORMAL_ENDS)
        axes.settle(target, self._limits.tolerance)
