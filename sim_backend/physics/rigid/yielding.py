"""What keys with a second coordinate have in common."""

from abc import ABC, abstractmethod

import pymunk

from sautereau.rig.instrument import Key
from sautereau.sim_backend.physics.rigid.key import StiffKey
from sautereau.sim_backend.physics.rigid.key_loads import KeyLoads
from sautereau.sim_backend.scene import Scene


class YieldingKey(StiffKey, ABC):
    """A key whose part before the pin, with felt and push, moves against the rest of the key.

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
