"""The moments on the key that no other body gives: weight, viscous friction, front felt."""

import math
from collections.abc import Callable

from sautereau.rig.instrument import Key
from sautereau.sim_backend.physics.rigid.bodies import MM, RAIL_REACH
from sautereau.sim_backend.physics.rigid.step_event import Happening
from sautereau.sim_backend.scene import Scene

TURNED = 1.0
"""rad, of the key, at which it has left the bench."""


class KeyLoads:
    """Moments [N mm] on the key over its angle [rad] and spin [rad/ms]."""

    def __init__(self, key: Key, scene: Scene):
        self.weight = key.gravity_moment * MM
        self.steady = self.weight
        """N mm, of weight and of what the finger puts on the key without touching it."""
        self.friction = key.pivot_coulomb_friction * MM if scene.friction else 0.0
        """N mm, dry, at the pin."""
        self.viscous = key.pivot_viscous_friction * MM**2 if scene.friction else 0.0
        """N mm ms/rad."""
        arm = key.press_arm * MM
        self.bottom = key.dip * MM / arm if scene.felt else TURNED
        """rad, where the key meets its felt."""
        self.felt_stiffness = key.felt_stiffness / MM * arm**2 if scene.felt else 0.0
        """N mm/rad."""
        self.felt_damping = key.felt_damping * arm**2 if scene.felt else 0.0
        """N mm ms/rad."""
        self.pressed = False
        """Whether the key is on its felt."""
        self.moment: Callable[[float, float], float] = self._slowed if self.viscous else self._free
        """N mm, at an angle [rad] and a spin [rad/ms]."""

    def bounds(self, angle: float) -> tuple[float, float]:
        """Return the angles [rad] between which nothing changes for a key at an angle."""
        if self.pressed:
            return self.bottom, TURNED
        if angle <= RAIL_REACH:
            return -math.inf, RAIL_REACH
        return 0.0, self.bottom

    def watched(self, angle: float, turned: Callable[[float], float]) -> list[Happening]:
        """Return what may happen to a key at an angle [rad], and at others after times [ms]."""
        if self.pressed:
            return [Happening(lambda t: turned(t) - self.bottom, self._cross)]
        watched = []
        if angle > RAIL_REACH:
            watched = [Happening(turned, _land, strikes=True)]
        if self.felt_stiffness:
            watched.append(Happening(lambda t: self.bottom - turned(t), self._cross))
        return watched

    def _cross(self, time: float) -> None:
        self.pressed = not self.pressed
        if self.pressed:
            self.moment = self._on_felt
        else:
            self.moment = self._slowed if self.viscous else self._free

    def _free(self, angle: float, spin: float) -> float:
        return self.steady

    def _slowed(self, angle: float, spin: float) -> float:
        return self.steady - self.viscous * spin

    def _on_felt(self, angle: float, spin: float) -> float:
        felt = self.felt_stiffness * (angle - self.bottom) + self.felt_damping * spin
        return self.steady - self.viscous * spin - max(0.0, felt)


def _land(time: float) -> None:
    """Change nothing: the rail is there."""
