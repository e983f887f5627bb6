"""Play at the balance pin: a key that sinks into the felt under it."""

import math
from collections.abc import Iterable

import pymunk

from sautereau.rig.instrument import Key
from sautereau.sim_backend.parts import Play
from sautereau.sim_backend.physics.rigid.bodies import (
    MM,
    RAIL_SLACK,
    set_force,
    set_position,
    set_torque,
)
from sautereau.sim_backend.physics.rigid.key_loads import stop_at_rail
from sautereau.sim_backend.physics.rigid.step_event import Event
from sautereau.sim_backend.physics.rigid.yielding import YieldingKey
from sautereau.sim_backend.scene import Scene


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
