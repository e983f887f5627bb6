"""A motor behind a gear with backlash: the side of a joint that its encoder sees."""

import math

from sautereau.sim_backend.parts import Joints
from sautereau.sim_backend.physics.rigid import bodies
from sautereau.sim_backend.physics.rigid.step_event import Kick


class Motor:
    """The motor of one joint, by leap-frog as the bodies: mm, g and ms.

    J theta'' = torque - c theta' - f sgn(theta') - T, and the link has T, with the wind-up
    e = theta - q beyond half the backlash to either side: T = k e + d (theta' - q'), where that
    pushes in the direction of e, else 0. The rotation of the rotor with link 1 is neglected, as
    in `trajectory.dynamics`.

    Args:
        joint: From 0.
        inertia: kg m^2, of the rotor at the joint.
        angle: rad, at the start.
    """

    def __init__(self, joints: Joints, joint: int, inertia: float, angle: float):
        self._inertia = inertia * bodies.INERTIA
        self._half = joints.backlash[joint] / 2
        self._stiffness = joints.gear_stiffness[joint] * bodies.MM
        self._damping = joints.gear_damping[joint] * bodies.MM**2
        self._dry = joints.dry_friction[joint] * bodies.MM
        self._viscous = joints.viscous_friction[joint] * bodies.MM**2
        self.angle = self._next = self._target = angle
        self._rate = self._next_rate = self._acceleration = 0.0

    def rate(self, mobility: float) -> float:
        """Return the rate [1/ms] of the gear's oscillation or decay.

        Args:
            mobility: 1 / (g mm^2), of the link.
        """
        both = mobility + 1 / self._inertia
        return max(math.sqrt(self._stiffness * both), self._damping * both)

    def drive(self, torque: float, kick: Kick, link: float, link_rate: float) -> float:
        """Prepare a step; return the torque [N mm] on the link in it.

        Args:
            torque: N mm, of the motor in the step.
            link: rad, angle of the joint at its end.
            link_rate: rad/ms.
        """
        self._next = self.angle + self._rate * kick.step
        wound = self._next - link
        wound -= max(-self._half, min(self._half, wound))
        passed = 0.0
        if wound:
            push = self._stiffness * wound + self._damping * (self._rate - link_rate)
            passed = push * kick.fraction if push * wound > 0 else 0.0
        time = kick.step / self._inertia
        rate = self._rate + (torque - passed) * time
        rate /= 1 + self._viscous * kick.fraction * time
        held = self._dry * kick.fraction * time
        self._next_rate = math.copysign(max(0.0, abs(rate) - held), rate)
        return passed

    def hold(self) -> None:
        """Be at rest, as with its brake on."""
        self._rate = self._acceleration = 0.0

    def end_step(self, weight: float) -> None:
        """End the step that `drive` has prepared, in which the forces acted for a weight [ms]."""
        self._acceleration = (self._next_rate - self._rate) / weight
        self.angle, self._rate = self._next, self._next_rate

    def correct_and_drift(self, back: float, drift: float) -> None:
        """Undo the surplus of the last impulse and compute the state after a drift, ms."""
        self._rate -= self._acceleration * back
        self._target = self.angle + self._rate * drift

    def set_back(self, step: float) -> None:
        """Be where a step [ms] ends at the target."""
        self.angle = self._target - self._rate * step
