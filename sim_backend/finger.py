"""The finger of the world: ideal, or two links under a servo."""

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np
import pymunk

from rig.schema import Rig
from sim_backend.bodies import INERTIA, MM, add_arm, add_brakes, add_ideal_finger
from sim_backend.errors import SceneError
from sim_backend.scene import Servo
from sim_backend.servo import PositionLoops
from trajectory.arm import fingertip_motion
from trajectory.dynamics import armature
from trajectory.motion import Floats, Motion

SETTLED = 10
"""Counts of following error at which a standing arm has settled."""

Reference = Callable[[Floats], tuple[Floats, Floats]]
"""Fractions of the sample to counts and counts a sample, each (n, 2)."""


class Finger(Protocol):
    """What presses the key."""

    def joints(self) -> tuple[float, float]:
        """Return the joint angles [rad]."""
        ...

    def torques(self) -> tuple[float, float]:
        """Return the motors' torques [N m]."""
        ...

    @property
    def settled(self) -> bool:
        """Whether the arm stands where it was told to."""
        ...

    def centre(self) -> tuple[float, float]:
        """Return the centre of the fingertip [mm]."""
        ...

    def begin(self, reference: Reference, powered: bool, steps: int) -> None:
        """Start a controller sample of so many steps."""
        ...

    def drive(self, step: int) -> None:
        """Act on the bodies before a step."""
        ...


class IdealFinger:
    """A fingertip exactly where the reference is.

    The solver gives the key the speed that the fingertip has when the step ends, and the
    key keeps it over the next step. So the fingertip carries its mean speed over that
    next step, and is put where that speed brings it to its place.
    """

    def __init__(self, space: pymunk.Space, rig: Rig, start: tuple[float, float]):
        self.rig = rig
        self.radians = 2 * math.pi / rig.arm.counts_per_revolution
        self.body = add_ideal_finger(space, rig.arm)
        self._joints = start
        self._start = np.array(start)
        self._positions: list[list[float]] = []
        centre = self._centre(np.array([start]))
        self.body.position = tuple(centre[0])

    def joints(self) -> tuple[float, float]:
        """Return the joint angles [rad]."""
        return self._joints

    def torques(self) -> tuple[float, float]:
        """Return zero: an ideal finger needs no motors."""
        return 0.0, 0.0

    @property
    def settled(self) -> bool:
        """True: an ideal finger is always where it was told to be."""
        return True

    def centre(self) -> tuple[float, float]:
        """Return the centre of the fingertip [mm]."""
        return self.body.position

    def begin(self, reference: Reference, powered: bool, steps: int) -> None:
        """Work out the fingertip's path over a controller sample."""
        fractions = np.arange(1, steps + 2) / steps
        counts, _ = reference(fractions)
        joints = self._start + counts * self.radians
        self._positions = self._centre(joints).tolist()
        self._joints = (float(joints[steps - 1, 0]), float(joints[steps - 1, 1]))
        self._step = self.rig.controller.sample_period / steps * MM

    def drive(self, step: int) -> None:
        """Set the fingertip's place and speed for a step."""
        (x, z), (next_x, next_z) = self._positions[step], self._positions[step + 1]
        self.body.position = (2 * x - next_x, 2 * z - next_z)
        self.body.velocity = ((next_x - x) / self._step, (next_z - z) / self._step)

    def _centre(self, joints: Floats) -> Floats:
        still = np.zeros_like(joints)
        return fingertip_motion(self.rig.arm, Motion(joints, still, still)).position * MM


class ServoFinger:
    """Two links, their motors under the controller's position loops.

    Link 1 turns as joint 1 does, and carries its armature. That of joint 2 resists the
    turning of one link against the other, which no rigid body does.

    Raises:
        SceneError: The motor of joint 2 has a rotor.
    """

    def __init__(self, space: pymunk.Space, rig: Rig, start: tuple[float, float], servo: Servo):
        first, second = armature(rig.arm)
        if second > 0:
            raise SceneError(
                f"arm.rotor_inertias: joint 2's rotor adds {second:.4g} kg m^2 to its joint, and a"
                f' servo scene models the rotor of joint 1 alone; set it to "0 kg m^2" in the'
                ' scene\'s table [truth] or in the rig, or take finger = "ideal"'
            )
        self.radians = 2 * math.pi / rig.arm.counts_per_revolution
        self.period = rig.controller.sample_period
        self.loops = PositionLoops(servo, rig.arm, self.period)
        self._half = rig.arm.lower_length / 2 * MM
        self.upper, self.lower = add_arm(space, rig.arm, start)
        self.upper.moment += first * INERTIA
        self.brakes = add_brakes(space, self.upper, self.lower)
        self._start = start
        self._powered = False
        self._error = (0.0, 0.0)
        self._torque = (0.0, 0.0)

    def joints(self) -> tuple[float, float]:
        """Return the joint angles [rad]."""
        return self.upper.angle, self.lower.angle - self.upper.angle

    def torques(self) -> tuple[float, float]:
        """Return the motors' torques [N m]."""
        return self._torque[0] / MM, self._torque[1] / MM

    @property
    def settled(self) -> bool:
        """Whether both loops are within `SETTLED` counts, or the motors are off."""
        return not self._powered or max(map(abs, self._error)) <= SETTLED

    def centre(self) -> tuple[float, float]:
        """Return the centre of the fingertip [mm]."""
        (x, z), angle = self.lower.position, self.lower.angle
        return x + self._half * math.cos(angle), z + self._half * math.sin(angle)

    def begin(self, reference: Reference, powered: bool, steps: int) -> None:
        """Read the encoders and set the torques for a controller sample."""
        if powered != self._powered:
            self._powered = powered
            for brake in self.brakes:
                brake.max_force = 0.0 if powered else math.inf
            if powered:
                self.loops.engage(self.joints())
        if not powered:
            self._torque = (0.0, 0.0)
            return
        counts, speeds = reference(np.array([0.0, 1.0]))
        joints = self.joints()
        error = [counts[0, j] - round((joints[j] - self._start[j]) / self.radians) for j in (0, 1)]
        spin = (speeds[1] - speeds[0]) * self.radians / self.period**2
        torque = self.loops.torque((float(error[0]), float(error[1])), (spin[0], spin[1]))
        self._error = (float(error[0]), float(error[1]))
        self._torque = (float(torque[0]) * MM, float(torque[1]) * MM)

    def drive(self, step: int) -> None:
        """Apply the motors' torques for a step."""
        first, second = self._torque
        self.upper.torque += first - second
        self.lower.torque += second
