"""An arm's homing and moves, whichever controller turns it.

Positions are counts, speeds counts a second.
"""

from abc import abstractmethod

import numpy as np

from sautereau.robot.drivers.connected import AxesT, ConnectedArm, WireT
from sautereau.robot.drivers.states import State
from sautereau.robot.errors import MotionFault
from sautereau.trajectory.counts import to_counts
from sautereau.trajectory.segments import Counts


class Arm(ConnectedArm[WireT, AxesT]):
    """Two joints that can be powered, homed and moved; arguments as for `ConnectedArm`."""

    @abstractmethod
    def _find_home(self, axes: AxesT, home: Counts) -> None:
        """Find the home switches, and set the positions there (counts, (2,))."""

    @abstractmethod
    def _home_levels(self, axes: AxesT) -> list[float]:
        """Return for each joint 0 at its home switch and below, 1 above."""

    @abstractmethod
    def _go(self, axes: AxesT, target: Counts, speed: float) -> None:
        """Move to a target (counts, (2,)) at counts a second, and stand there."""

    def home(self) -> Counts:
        """Find the home switches; return the joint positions (counts, (2,)) set there."""
        axes = self._axes("home")
        self._states.require("home")
        home = self._home_counts()
        with self._guarded(axes), self._states.moving(State.HOMED):
            self._find_home(axes, home)
        return home

    def check_home(self) -> None:
        """Go back to the home switches, and refuse to go on if they are not where they were.

        The arm comes to either side of them, `controller.home_tolerance` off.

        Raises:
            MotionFault: An encoder has slipped, or a switch has moved; the motors are off.
        """
        axes = self._axes("check_home")
        self._states.require("check_home")
        home, tolerance = self._home_counts(), self._settings.home_tolerance
        levels = []
        for side in (-1, 1):
            self.move_to(home + side * tolerance, self._limits.in_counts(self._arm.approach_speed))
            levels.append(self._home_levels(axes))
        slipped = [
            f"joint {joint}"
            for joint, (before, behind) in enumerate(zip(*levels, strict=True), 1)
            if (before, behind) != (0, 1)
        ]
        if slipped:
            with self._guarded(axes):
                raise MotionFault(
                    f"the home switch of {' and '.join(slipped)} is not within {tolerance} counts"
                    " of where it was found (controller.home_tolerance): an encoder has slipped or"
                    " a switch has moved; distrust what was recorded since home(), check coupling"
                    " and switch, then home() again"
                )

    def move_to(self, counts: Counts, speed_counts_per_s: float) -> Counts:
        """Move both joints from point to point, and wait until they stand there.

        Args:
            counts: Counts, absolute target of each joint; shape (2,).
            speed_counts_per_s: Counts a second, largest of either joint; lowered to the next
                that the controller takes.

        Returns:
            Counts, target as it was sent; shape (2,).
        """
        axes = self._axes("move_to")
        self._states.require("move_to")
        target = np.rint(counts).astype(np.int64)
        self._limits.check_move(target, speed_counts_per_s)
        loaded = self._states.now is not State.HOMED
        with (
            self._guarded(axes),
            self._states.moving(State.LOADED if loaded else State.HOMED),
        ):
            self._go(axes, target, speed_counts_per_s)
        return target

    def _home_counts(self) -> Counts:
        return to_counts(self._arm.home_angles, self._arm.counts_per_revolution)
