"""Moments on the key that no other body exerts: weight, viscous friction, front felt."""

import math
from collections.abc import Callable

from sautereau.rig.instrument import Key
from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.physics.base import LARGEST_ANGLE
from sautereau.sim_backend.physics.rigid.bodies import MM, RAIL_REACH
from sautereau.sim_backend.physics.rigid.step_event import Event
from sautereau.sim_backend.scene import Scene


class KeyLoads:
    """Moments [N mm] on the key over its angle [rad] and angular velocity [rad/ms].

    Args:
        scene: Which of them are enabled.
        front: Whether they include those before the pin, felt and push.
        back: Whether they include the others.
    """

    def __init__(self, key: Key, scene: Scene, *, front: bool = True, back: bool = True):
        felt, friction = scene.felt and front, scene.friction and back
        self._on_rail = back
        self.weight = back * key.gravity_moment * MM * scene.gravity / GRAVITY
        self.steady = self.weight
        """N mm, of weight and of a push without contact."""
        self.friction = key.pivot_coulomb_friction * MM if friction else 0.0
        """N mm, dry, at the pin."""
        self.viscous = key.pivot_viscous_friction * MM**2 if friction else 0.0
        """N mm ms/rad."""
        arm = key.press_arm * MM
        self.bottom = key.dip * MM / arm if felt else LARGEST_ANGLE
        """rad, at first contact with the felt."""
        self.felt_stiffness = key.felt_stiffness / MM * arm**2 if felt else 0.0
        """N mm/rad."""
        self.felt_damping = key.felt_damping * arm**2 if felt else 0.0
        """N mm ms/rad."""
        self.pressed = False
        """Whether the key is in contact with its felt."""
        self.moment: Callable[[float, float], float] = self._slowed if self.viscous else self._free
        """N mm, at an angle [rad] and an angular velocity [rad/ms]."""

    def bounds(self, angle: float) -> tuple[float, float]:
        """Return the angles [rad] between which a key at an angle has no event."""
        if self.pressed:
            return self.bottom, LARGEST_ANGLE
        if not self._on_rail:
            return -math.inf, self.bottom
        if angle <= RAIL_REACH:
            return -math.inf, RAIL_REACH
        return 0.0, self.bottom

    def possible_events(self, angle: float, turned: Callable[[float], float]) -> list[Event]:
        """Return the events possible for a key at an angle [rad]; `turned` gives later angles."""
        if self.pressed:
            return [Event(lambda t: turned(t) - self.bottom, self._cross)]
        possible = []
        if self._on_rail and angle > RAIL_REACH:
            possible = [Event(turned, stop_at_rail, impact=True)]
        if self.felt_stiffness:
            possible.append(Event(lambda t: self.bottom - turned(t), self._cross))
        return possible

    def _cross(self, time: float) -> None:
        self.pressed = not self.pressed
        if self.pressed:
            self.moment = self._on_felt
        else:
            self.moment = self._slowed if self.viscous else self._free

    def _free(self, angle: float, omega: float) -> float:
        return self.steady

    def _slowed(self, angle: float, omega: float) -> float:
        return self.steady - self.viscous * omega

    def _on_felt(self, angle: float, omega: float) -> float:
        felt = self.felt_stiffness * (angle - self.bottom) + self.felt_damping * omega
        return self.steady - self.viscous * omega - max(0.0, felt)


def stop_at_rail(time: float) -> None:
    """Do nothing: the joint of the rail acts by itself."""
