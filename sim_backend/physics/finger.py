"""What presses the key, for every engine."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from sautereau.rig.schema import Arm
from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.errors import SceneError
from sautereau.trajectory.dynamics import gravity_torque
from sautereau.trajectory.motion import Floats

SETTLED = 5e-6  # Revolutions of following error up to which an arm at rest has settled
Reference = Callable[[Floats], tuple[Floats, Floats]]
"""Maps fractions of the sample to counts and counts per sample, each of shape (n, 2)."""


def joint_cubics(start: Sequence[float], counts: Floats, speeds: Floats, radians: float) -> Floats:
    """Return the joints' cubics [rad] over controller samples; shape (samples, 2 joints, 4).

    Args:
        start: rad, joints where the counts are 0.
        counts: At the ends of the samples; shape (samples + 1, 2).
        speeds: Counts per sample, of the same shape.
        radians: rad per count.
    """
    places, v = counts * radians, speeds * radians
    step, v0, v1 = places[1:] - places[:-1], v[:-1], v[1:]
    cubics = np.empty((*step.shape, 4))  # filled by parts: np.stack takes three times as long
    cubics[..., 0], cubics[..., 1] = start + places[:-1], v0
    cubics[..., 2], cubics[..., 3] = 3 * step - 2 * v0 - v1, v0 + v1 - 2 * step
    return cubics


class Finger:
    """What presses the key; without motors, as here, it follows its reference exactly.

    Args:
        joints: rad, at the start.
    """

    def __init__(self, joints: tuple[float, float]):
        self._joints = joints

    def joints(self) -> tuple[float, float]:
        """Return the joint angles [rad]."""
        return self._joints

    def torques(self) -> tuple[float, float]:
        """Return the motors' torques [N m]."""
        return 0.0, 0.0

    def drive(self, offsets: tuple[float, float], limits: tuple[float, float]) -> None:
        """Add offsets [N m] to the loops' torques from now on, and limit the sum [N m]."""

    def block(self, joint: int) -> None:
        """Block the motor of a joint, counted from 0, from now on.

        Raises:
            SceneError: There are no motors.
        """
        raise SceneError("faults.stall: the arm has no motors; remove the table")

    @property
    def settled(self) -> bool:
        """Whether the arm rests at its reference."""
        return True


class LoopedFinger(Finger):
    """A finger with two motors under position loops, in either engine.

    Args:
        loops: Of `structures.FINGER`: parameters and state of the loops.
        gravity: m/s^2.
    """

    def __init__(self, loops: Any, arm: Arm, gravity: float):
        self._arm, self._loops, self._gravity = arm, loops, gravity
        self._powered = False

    def torques(self) -> tuple[float, float]:
        return float(self._loops.torque[0]), float(self._loops.torque[1])

    @property
    def settled(self) -> bool:
        """Whether both loops are within `SETTLED` or a count, or the motors are off."""
        # Half a count more, so that the comparison with a count is not one of equal numbers.
        count = 1 / self._arm.counts_per_revolution
        within = 2 * math.pi * (max(SETTLED, count) + count / 2)
        return not self._powered or max(map(abs, self._loops.lag)) <= within

    def drive(self, offsets: tuple[float, float], limits: tuple[float, float]) -> None:
        self._loops.offset[:] = offsets
        self._loops.limit[:] = np.minimum(limits, self._arm.torque_limit).tolist()

    def switch(self, powered: bool) -> bool:
        """Switch the motors on, the integrators at the torques of the arm's weight, or off.

        Returns:
            Whether that is a change.
        """
        if powered == self._powered:
            return False
        self._powered, loops = powered, self._loops
        weight = gravity_torque(self._arm, np.array(self.joints())) * (self._gravity / GRAVITY)
        for j in range(2):
            loops.integral[j], loops.lag[j], loops.torque[j] = float(weight[j]), 0.0, 0.0
        return True
