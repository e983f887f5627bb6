"""The key's front, which bends against its back about the balance pin."""

import math
from collections.abc import Callable

import pymunk

from sautereau.sim_backend.parts import Bending
from sautereau.sim_backend.physics.rigid.bodies import MM, add_front, set_angle, set_torque
from sautereau.sim_backend.physics.rigid.key_loads import KeyLoads


class Front:
    """The part of the key before the pin, on a rotational spring and damper to the part behind it.

    Like the key, its angular velocity is that half a step ahead of its angle.

    Args:
        space: The world.
        key: Body of the complete key, which becomes that of its back.
        bending: Frequency, damping and the front's part of the inertia.
        loads: On the front, felt and push.
    """

    def __init__(self, space: pymunk.Space, key: pymunk.Body, bending: Bending, loads: KeyLoads):
        inertia, omega = key.moment, 2 * math.pi * bending.frequency / MM
        reduced = inertia * bending.front * (1 - bending.front)
        self.body = add_front(space, inertia * bending.front)
        key.moment = inertia * (1 - bending.front)
        self.loads = loads
        self._stiffness, self._damping = reduced * omega**2, 2 * bending.damping * omega * reduced
        self.rate = omega * max(1.0, 2 * bending.damping)
        """1/ms, fastest that a step must resolve."""
        self.angle = self.next = self.node = 0.0
        """rad, at the start and at the end of a step; rad/ms, at its end."""
        self.omega = self.acceleration = 0.0
        self._torque = self._twist = 0.0

    def stays(self, step: float) -> bool:
        """Advance to the end of a step [ms]; return whether no mode changes on the way."""
        low, high = self.loads.bounds(self.angle)
        self.next = self.angle + self.omega * step
        self.node = self.omega + self.acceleration * step / 2
        return low < self.next < high

    def correct_and_drift(self, back: float, drift: float) -> None:
        """Undo the surplus of the last impulse [ms] and compute the state after a drift [ms]."""
        self.omega -= self.acceleration * back
        self.stays(drift)

    def moment(self) -> float:
        """Return the moment [N mm] of felt and push at the end of the step."""
        return self.loads.moment(self.next, self.node)

    def twist(self, angle: float, omega: float) -> float:
        """Return the moment [N mm] of the spring on the back, at its angle and velocity."""
        return self._stiffness * (self.next - angle) + self._damping * (self.node - omega)

    def apply(self, moment: float) -> None:
        """Apply a moment [N mm] in the engine's next step."""
        set_torque(self.body, moment)

    def turned(self, ahead: float) -> Callable[[float], float]:
        """Return its angle [rad] after a time [ms]; see `CarriedJack.possible_events`."""
        angle, omega = self.angle, self.omega - self.acceleration * ahead / 2
        return lambda time: angle + (omega + self.acceleration * time / 2) * time

    def set_bodies(self, step: float) -> None:
        """Set the body so that a step [ms] of the engine ends in its target state."""
        self.body.angle, self.body.angular_velocity = self.next - self.omega * step, self.omega

    def update(self, grown: Callable[[float], float]) -> float:
        """Update the state after a step; return the mean of both angular velocities [rad/ms].

        Args:
            grown: Acceleration [rad/ms^2] by the growth of the angular velocity.
        """
        before, self.omega = self.omega, self.body.angular_velocity
        self.angle, self.acceleration = self.next, grown(self.omega - before)
        return (before + self.omega) / 2

    def end_sample(self, angle: float) -> None:
        """Move the body to an angle [rad]."""
        self.angle = angle
        set_angle(self.body, angle)
