"""The simulated arm as the controller's cables show it: encoders, switches, amplifiers."""

import numpy as np

from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.finger import Reference
from sautereau.sim_backend.physics.rigid.arm import ServoFinger
from sautereau.sim_backend.physics.rigid.bodies import brakes
from sautereau.sim_backend.physics.world import World
from sautereau.trajectory.motion import Floats

AMPLIFIER_VOLTS = 9.998
"""V, command of an amplifier at the torque limit."""


class ArmPlant:
    """Motors and encoders of a world's arm, which may slip and stall."""

    def __init__(self, world: World):
        self._world = world
        self._slipped = np.zeros(2, int)
        self._encoders = self._counts(world.finger.joints())

    def encoder_counts(self) -> tuple[int, int]:
        """Return the raw encoder counts since power-up, as they were at the last `sample`."""
        return self._encoders

    def home_counts(self) -> tuple[int, int]:
        """Return the raw encoder counts at the home switches."""
        return self._counts(self._world.rig.arm.home_angles)

    def torque_volts(self) -> tuple[float, float]:
        """Return the commands to the amplifiers [V]."""
        limit = self._world.rig.arm.torque_limit
        first, second = self._world.finger.torques()
        return first / limit * AMPLIFIER_VOLTS, second / limit * AMPLIFIER_VOLTS

    def drive(self, offsets: tuple[float, float], limits: tuple[float, float]) -> None:
        """Add offsets [V] to the loops' commands from now on, and limit [V] what goes out."""
        volt = self._world.rig.arm.torque_limit / AMPLIFIER_VOLTS
        finger = self._world.finger
        if isinstance(finger, ServoFinger):
            finger.drive(
                (offsets[0] * volt, offsets[1] * volt), (limits[0] * volt, limits[1] * volt)
            )

    def sample(self) -> None:
        """Read the encoders where the world is now."""
        self._encoders = self._counts(self._world.finger.joints())

    def slip(self, joint: int, counts: int) -> None:
        """Let the encoder of a joint (1 or 2) read so much more from now on."""
        self._slipped[joint - 1] += counts
        self.sample()

    def stall(self, joint: int) -> None:
        """Let the motor of a joint (1 or 2) stand from now on."""
        finger = self._world.finger
        if not isinstance(finger, ServoFinger) or (space := finger.upper.space) is None:
            raise SceneError("faults.stall: the arm has no motors; remove the table")
        space.add(brakes(space, finger.upper, finger.lower)[joint - 1])

    def wired(self, reference: Reference) -> Reference:
        """Return the controller's reference as the loops close on it.

        They follow the encoders, so what those read too much the arm stands short of it.
        """
        if not self._slipped.any():
            return reference

        def of_arm(fractions: Floats) -> tuple[Floats, Floats]:
            counts, speeds = reference(fractions)
            return counts - self._slipped, speeds

        return of_arm

    def _counts(self, joints: tuple[float, float]) -> tuple[int, int]:
        start, radians = self._world.start, self._world.radians_per_count
        first, second = self._slipped.tolist()
        return (
            round((joints[0] - start[0]) / radians) + first,
            round((joints[1] - start[1]) / radians) + second,
        )
