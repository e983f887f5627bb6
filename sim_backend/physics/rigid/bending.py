"""A key that bends at its pin."""

import math

import pymunk

from sautereau.rig.instrument import Key
from sautereau.sim_backend.parts import Bending
from sautereau.sim_backend.physics.rigid.bodies import MM, add_front, set_torque
from sautereau.sim_backend.physics.rigid.step_event import Event
from sautereau.sim_backend.physics.rigid.yielding import YieldingKey
from sautereau.sim_backend.scene import Scene


class BendingKey(YieldingKey):
    """A key in two parts; the second coordinate is the angle of the part before the pin.

    A rotational spring and damper join it to the part behind the pin.

    Args:
        scene: See `StiffKey`.
        angle: rad, at rest.
        bending: Frequency, damping and the front's part of the inertia.
    """

    what, keys = "the key's bending", "bending.frequency or bending.damping"

    def __init__(self, space: pymunk.Space, key: Key, scene: Scene, angle: float, bending: Bending):
        super().__init__(space, key, scene, angle)
        inertia, omega = self.inertia, 2 * math.pi * bending.frequency / MM
        reduced = inertia * bending.front * (1 - bending.front)
        self.lever = add_front(space, inertia * bending.front)
        self.lever.angle = self.second.value = angle
        self.pressed = self.second
        self.rate = omega * max(1.0, 2 * bending.damping)
        self.inertia = self.body.moment = inertia * (1 - bending.front)
        self._stiffness, self._damping = reduced * omega**2, 2 * bending.damping * omega * reduced

    def depth(self, angle: float, second: float) -> float:
        """Return the angle of the front."""
        return second

    def seen(self, angle: float, second: float) -> float:
        """Return the angle of the front, where the laser is."""
        return second

    def second_speed(self) -> float:
        """Return the angular velocity [rad/ms] of the front."""
        return self.lever.angular_velocity

    def apply(self, back: float, front: float, fraction: float = 1.0) -> None:
        """Apply the loads, and the moment of the spring on both parts; see `StiffKey`."""
        bent, rate = self.second.next - self.next, self.second.node - self.node
        spring = (self._stiffness * bent + self._damping * rate) * fraction
        set_torque(self.lever, front * fraction - spring)
        set_torque(self.body, back * fraction + spring)

    def set_bodies(self, step: float) -> None:
        super().set_bodies(step)
        lever, front = self.lever, self.second
        lever.angle, lever.angular_velocity = front.next - front.speed * step, front.speed

    def possible_events(self, ahead: float) -> list[Event]:
        """Return the events of the felt and of the part behind the pin; see `StiffKey`."""
        front = self.second
        felt = self.pressed_loads.possible_events(front.value, lambda t: front.at(t, ahead))
        return felt + super().possible_events(ahead)

    def _settle(self) -> float:
        self.second.value = self.lever.angle
        return 0.0
