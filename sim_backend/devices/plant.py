"""The simulated arm as the controller sees it: encoders, home switches, amplifiers."""

import numpy as np

from sautereau.sim_backend.devices.emulators import AMPLIFIER_VOLTS
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.finger import Reference
from sautereau.sim_backend.physics.rigid.arm import ServoFinger
from sautereau.sim_backend.physics.rigid.bodies import brakes
from sautereau.sim_backend.physics.world import World
from sautereau.trajectory.motion import Floats


class ArmPlant:
    """Motors and encoders of a world's arm; encoders may slip and motors stall."""

    def __init__(self, world: World):
        self._world = world
        self._slipped = np.zeros(2, int)
        self._encoders = self._counts(world.finger.joints())

    def encoder_counts(self) -> tuple[int, int]:
        """Return the raw encoder counts since power-up, as of the last `sample`."""
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
        """Add offsets [V] to the loops' commands from now on, and limit [V] the sums."""
        volt = self._world.rig.arm.torque_limit / AMPLIFIER_VOLTS
        finger = self._world.finger
        if isinstance(finger, ServoFinger):
            finger.drive(
                (offsets[0] * volt, offsets[1] * volt), (limits[0] * volt, limits[1] * volt)
            )

    def sample(self) -> None:
        """Read the encoders now."""
        self._encoders = self._counts(self._world.finger.joints())

    def slip(self, joint: int, counts: int) -> None:
        """Offset the readings of a joint's (1 or 2) encoder by ``counts`` from now on."""
        self._slipped[joint - 1] += counts
        self.sample()

    def stall(self, joint: int) -> None:
        """Block the motor of a joint (1 or 2) from now on."""
        finger = self._world.finger
        if not isinstance(finger, ServoFinger) or (space := finger.upper.space) is None:
            raise SceneError("faults.stall: the arm has no motors; remove the table")
        space.add(brakes(space, finger.upper, finger.lower)[joint - 1])

    def wired(self, reference: Reference) -> Reference:
        """Return the controller's reference as the position loops apply it to the arm.

        The loops follow the encoders, so the arm is off by the negative of the encoders' slip.
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
