"""The bench of a scene in numbers."""

import math
from dataclasses import dataclass

from sautereau.rig.schema import Rig
from sautereau.rig.section import GRAVITY
from sautereau.sim_backend.physics.reference.jack import JackLaw
from sautereau.sim_backend.physics.reference.legs import Leg
from sautereau.sim_backend.physics.reference.linkage import Linkage, Touch
from sautereau.sim_backend.scene import Scene

State = list[float]
"""Key's angle and speed; each jack's rise and speed; the joints of the arm and their speeds."""


@dataclass(frozen=True)
class System:
    """The bench of a scene."""

    name: str
    inertia: float
    """kg m^2."""
    heaviness: float
    """N m."""
    viscous: float
    """N m s/rad."""
    dry: float
    """N m."""
    press_arm: float
    """m."""
    dip: float
    """rad, at which the front meets the felt; infinite for none."""
    felt_stiffness: float
    """N m/rad."""
    felt_damping: float
    """N m s/rad."""
    jacks: tuple[JackLaw, ...]
    arm: Linkage | None
    """Where it is a body of its own."""

    @classmethod
    def of(
        cls, rig: Rig, scene: Scene, jacks: tuple[JackLaw, ...], arm: Linkage | None
    ) -> "System":
        """Return the bench in numbers.

        Args:
            rig: As it truly is.
            scene: What of it is shown.
            jacks: Of the rig in this scene.
            arm: Where it is a body of its own.
        """
        key = rig.key
        return cls(
            name=rig.name,
            inertia=key.inertia,
            heaviness=key.gravity_moment,
            viscous=key.pivot_viscous_friction if scene.friction else 0.0,
            dry=key.pivot_coulomb_friction if scene.friction else 0.0,
            press_arm=key.press_arm,
            dip=key.dip / key.press_arm if scene.felt else math.inf,
            felt_stiffness=key.felt_stiffness * key.press_arm**2,
            felt_damping=key.felt_damping * key.press_arm**2,
            jacks=jacks,
            arm=arm,
        )

    @property
    def moment_scale(self) -> float:
        """N m, of the weights and the dry friction about the pin."""
        load = sum((j.mass * GRAVITY + j.friction) * j.arm for j in self.jacks)
        return abs(self.heaviness) + self.dry + load

    def felt(self, angle: float, spin: float) -> float:
        """Return what the felt's spring and damper give [N m], pushing or not."""
        return self.felt_stiffness * (angle - self.dip) + self.felt_damping * spin

    def touch(self, leg: Leg, time: float, x: State) -> Touch | None:
        """Return the key that the fingertip would touch, or None without a fingertip."""
        if self.arm:
            return self.arm.touch(*x[-4:])
        return leg.path.lead(time).touch if leg.path else None
