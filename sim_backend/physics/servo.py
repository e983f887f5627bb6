"""The two position loops: PID on encoder counts at the controller's sample."""

import numpy as np

from sautereau.rig.schema import Arm
from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.parts import Servo
from sautereau.trajectory.dynamics import gravity_torque


class PositionLoops:
    """Compute the torque of each joint from reference and encoder, once per sample."""

    def __init__(self, servo: Servo, arm: Arm, period: float, gravity: float = GRAVITY):
        self.servo = servo
        self.arm = arm
        self.period = period
        self._gravity = gravity
        self.radians = arm.radians_per_count
        self.offsets = (0.0, 0.0)
        """N m, added to the loops' torques."""
        self.limits = (arm.torque_limit, arm.torque_limit)
        """N m, of the controller; the motors have limits of their own."""
        self._integral = [0.0, 0.0]
        self._last = [0.0, 0.0]

    def engage(self, joints: tuple[float, float]) -> None:
        """Take over an arm at rest: the integrators start at the torques of its weight."""
        weight = gravity_torque(self.arm, np.array(joints)) * (self._gravity / GRAVITY)
        self._integral = weight.tolist()
        self._last = [0.0, 0.0]

    def torque(
        self, error: tuple[float, float], acceleration: tuple[float, float]
    ) -> tuple[float, float]:
        """Return the joint torques [N m] for the sample that starts.

        Args:
            error: Counts, reference minus encoder.
            acceleration: rad/s^2, of the reference.
        """
        servo = self.servo
        torques = []
        for j in (0, 1):
            limit = min(self.limits[j], self.arm.torque_limit)
            lag = error[j] * self.radians
            rate = (lag - self._last[j]) / self.period
            self._last[j] = lag
            torque = (
                servo.stiffness[j] * lag
                + servo.damping[j] * rate
                + servo.feedforward[j] * acceleration[j]
                + self._integral[j]
                + self.offsets[j]
            )
            if abs(torque) < limit:  # no integrator wind-up while the amplifier saturates
                self._integral[j] += servo.stiffness[j] * lag * self.period / servo.integral_time
            torques.append(max(-limit, min(limit, torque)))
        return torques[0], torques[1]
