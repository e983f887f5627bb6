"""The parameters of a scene's bench."""

import math
from dataclasses import dataclass

from sautereau.rig.schema import Rig
from sautereau.rig.section import GRAVITY
from sautereau.sim_backend.physics.reference.drive_segments import DriveSegment
from sautereau.sim_backend.physics.reference.jack import JackLaw
from sautereau.sim_backend.physics.reference.linkage import KeyUnderFingertip, Linkage
from sautereau.sim_backend.scene import Scene

State = list[float]
"""Key's angle and speed; each jack's rise and speed; the joints of the arm and their speeds."""


@dataclass(frozen=True)
class System:
    """Parameters of the bench of a scene."""

    name: str
    inertia: float
    """kg m^2."""
    gravity_moment: float
    """N m."""
    viscous: float
    """N m s/rad."""
    dry: float
    """N m."""
    press_arm: float
    """m."""
    dip: float
    """rad, at first contact with the felt; infinite without a felt."""
    felt_stiffness: float
    """N m/rad."""
    felt_damping: float
    """N m s/rad."""
    jacks: tuple[JackLaw, ...]
    arm: Linkage | None
    """The arm, if it is simulated."""

    @classmethod
    def of(
        cls, rig: Rig, scene: Scene, jacks: tuple[JackLaw, ...], arm: Linkage | None
    ) -> "System":
        """Return the parameters of a bench.

        Args:
            rig: The true bench.
            scene: Which parts are enabled.
            jacks: Of the rig in this scene.
            arm: The arm, if it is simulated.
        """
        key = rig.key
        return cls(
            name=rig.name,
            inertia=key.inertia,
            gravity_moment=key.gravity_moment,
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
        """N m, sum of the weights and the dry friction about the pin."""
        load = sum((j.mass * GRAVITY + j.friction) * j.arm for j in self.jacks)
        return abs(self.gravity_moment) + self.dry + load

    def felt(self, angle: float, omega: float) -> float:
        """Return the moment of the felt's spring and damper [N m]; negative if it would pull."""
        return self.felt_stiffness * (angle - self.dip) + self.felt_damping * omega

    def key_under_fingertip(
        self, segment: DriveSegment, time: float, x: State
    ) -> KeyUnderFingertip | None:
        """Return the key in contact with the fingertip, or None without a fingertip."""
        if self.arm:
            return self.arm.key_under_fingertip(*x[-4:])
        return segment.path.key_motion(time).contact if segment.path else None
