"""Keys with a second coordinate: one bends at its pin, one sinks into the felt under it."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable

import pymunk

from sautereau.rig.instrument import Key
from sautereau.sim_backend.parts import Bending, Play
from sautereau.sim_backend.physics.rigid.bodies import (
    MM,
    RAIL_SLACK,
    add_front,
    set_force,
    set_position,
    set_torque,
)
from sautereau.sim_backend.physics.rigid.key import KeyLoads, StiffKey, stop_at_rail
from sautereau.sim_backend.physics.rigid.step_event import Event
from sautereau.sim_backend.scene import Scene


class YieldingKey(StiffKey, ABC):
    """What they have in common: the part before the pin, with felt and push, moves on its own.

    `loads` are those behind the pin only.
    """

    def __init__(self, space: pymunk.Space, key: Key, scene: Scene, angle: float):
        super().__init__(space, key, scene, angle)
        self.loads = KeyLoads(key, scene, front=False)
        self.pressed_loads = KeyLoads(key, scene, back=False)

    @abstractmethod
    def second_speed(self) -> float:
        """Return the speed of the second coordinate's body."""

    @abstractmethod
    def depth(self, angle: float, second: float) -> float:
        """Return the angle [rad] or rate [rad/ms] on which the loads before the pin depend.

        Args:
            angle: Angle or rate of this coordinate.
            second: The same of the second coordinate.
        """

    def correct(self, back: float) -> None:
        super().correct(back)
        self.second.correct(back)

    def stays(self, step: float) -> bool:
        self.second.drift(step)
        stays = super().stays(step)
        low, high = self.pressed_loads.bounds(self.value)
        return stays and low < self.depth(self.next, self.second.next) < high

    def load(self) -> None:
        back, front = self.moments()
        self.apply(back, front)

    def moments(self) -> tuple[float, float]:
        second = self.second
        angle, rate = self.depth(self.next, second.next), self.depth(self.node, second.node)
        return self.loads.moment(self.next, self.node), self.pressed_loads.moment(angle, rate)

    def update(self, step: float) -> tuple[float, float]:
        _, rate = super().update(step)
        rate = self.seen(rate, self.second.advance(self.second_speed(), step))
        return self.seen(self.value, self.second.value), rate

    def update_at_event(self, drift: float, ahead: float, impact: bool) -> None:
        super().update_at_event(drift, ahead, impact)
        self.second.advance_to_event(self.second_speed(), drift, ahead, impact)


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


class SinkingKey(YieldingKey):
    """A key on a balance felt, with a rail under it.

    The second coordinate is the height [mm] of the pin above that at rest.

    Args:
        scene: See `StiffKey`.
        angle: rad, at rest.
        play: Stiffness and damping of the felt, and its travel.
    """

    what, keys = "the balance felt", "play.stiffness or play.damping, or raise play.mass"

    def __init__(self, space: pymunk.Space, key: Key, scene: Scene, angle: float, play: Play):
        super().__init__(space, key, scene, angle)
        self.pin = self.second
        self.pin.fixed = False
        self._stiffness, self._damping = play.stiffness / MM, play.damping
        self.rate = max(math.sqrt(self._stiffness / self.mass), self._damping / self.mass)
        self._press_arm, self._laser_arm = key.press_arm * MM, key.laser_arm * MM
        self._lowest = -play.clearance * MM
        self._load = -self.mass * space.gravity[1]

    def carry(self, forces: Iterable[float]) -> None:
        """Add the jacks' forces [N] on the key at rest to what the felt carries there."""
        self._load += sum(forces)

    def depth(self, angle: float, second: float) -> float:
        """Return the depth of the pressing point over its arm [rad]."""
        return angle - second / self._press_arm

    def seen(self, angle: float, second: float) -> float:
        """Return the depth of the front under the laser over its arm [rad]."""
        return angle - second / self._laser_arm

    def second_speed(self) -> float:
        """Return the vertical speed [mm/ms] of the key."""
        return self.body.velocity[1]

    def stays(self, step: float) -> bool:
        stays, height = super().stays(step), self.pin.next
        if self._rests(self.pin.value):
            return stays and self._rests(height)
        return stays and height > self._lowest

    def apply(self, back: float, front: float, fraction: float = 1.0) -> None:
        """Apply the loads, and the balance felt's force, which can only push; see `StiffKey`."""
        pin, push = self.pin, front * fraction
        felt = max(0.0, self._load - self._stiffness * pin.next - self._damping * pin.node)
        set_force(self.body, (0.0, felt * fraction - push / self._press_arm))
        set_torque(self.body, back * fraction + push)

    def set_bodies(self, step: float) -> None:
        super().set_bodies(step)
        pin = self.pin
        self.body.position, self.body.velocity = (0.0, pin.next - pin.speed * step), (0, pin.speed)

    def possible_events(self, ahead: float) -> list[Event]:
        """Return the events of both felts and of both rails; see `StiffKey`."""
        pin, depth = self.pin, self.depth
        events = self.pressed_loads.possible_events(
            self.value, lambda time: depth(self.at(time, ahead), pin.at(time, ahead))
        )
        if not self._rests(pin.value):
            margin = lambda time: pin.at(time, ahead) - self._lowest  # noqa: E731
            events.append(Event(margin, stop_at_rail, impact=True))
        return events + super().possible_events(ahead)

    def _settle(self) -> float:
        set_position(self.body, (0.0, self.pin.value))
        return self.pin.value

    def _rests(self, height: float) -> bool:
        return height <= self._lowest + RAIL_SLACK
