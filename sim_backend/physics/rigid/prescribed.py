"""What fingers of prescribed motion have in common."""

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.sim_backend.physics.finger import Reference, joint_cubics
from sautereau.sim_backend.physics.rigid.bodies import MM
from sautereau.sim_backend.physics.rigid.finger import SteppedFinger
from sautereau.sim_backend.physics.rigid.pad import fingertip_state

_ENDS = np.array([0.0, 1.0, 2.0])


class PrescribedFinger(SteppedFinger):
    """A finger whose joints follow the reference exactly.

    Args:
        start: rad, joints when power comes on.
    """

    def __init__(self, rig: Rig, start: tuple[float, float]):
        super().__init__(start)
        arm = rig.arm
        self._start, self._radians = start, arm.radians_per_count
        self._period = rig.controller.sample_period * MM
        self._base = arm.base_x * MM, arm.base_z * MM
        self._lengths = arm.upper_length * MM, arm.lower_length * MM
        self._height = (rig.key.surface_height + arm.fingertip_radius) * MM
        """mm, of the fingertip's centre above the surface through the pin, in contact."""
        still = [[angle, 0.0, 0.0, 0.0] for angle in start]
        self._cubics = [still, still]

    def begin_sample(self, reference: Reference, powered: bool, time: float) -> bool:
        """Adopt the reference of a controller sample and of the next; see `SteppedFinger`."""
        self._cubics = joint_cubics(self._start, *reference(_ENDS), self._radians).tolist()
        first, second = map(sum, self._cubics[0])
        self._joints = first, second
        return False

    def tip(self, elapsed: float) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return place [mm] and velocity [mm/ms] of the fingertip's centre at a time [ms]."""
        u = elapsed / self._period
        cubics = self._cubics[u > 1]
        u -= u > 1
        first, second = (a + u * (b + u * (c + u * d)) for a, b, c, d in cubics)
        rate1, rate2 = ((b + u * (2 * c + u * 3 * d)) / self._period for _, b, c, d in cubics)
        return fingertip_state(self._base, self._lengths, (first, second), (rate1, rate2))
