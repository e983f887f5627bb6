"""A fingertip of prescribed motion with a compliant pad."""

import math

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.sim_backend.parts import Fingertip
from sautereau.sim_backend.physics.finger import Reference, joint_cubics
from sautereau.sim_backend.physics.rigid.bodies import MM
from sautereau.sim_backend.physics.rigid.finger import SteppedFinger
from sautereau.sim_backend.physics.rigid.key import StiffKey
from sautereau.sim_backend.physics.rigid.pad import Pad, fingertip_state
from sautereau.sim_backend.physics.rigid.step_event import Kick
from sautereau.trajectory.motion import Floats

_ENDS = np.array([0.0, 1.0])


class PaddedIdealFinger(SteppedFinger):
    """A fingertip of prescribed motion with a pad.

    Args:
        key: The key under it.
        rig: The bench.
        fingertip: The pad.
        start: rad, joints when power comes on.
    """

    def __init__(
        self,
        key: StiffKey,
        rig: Rig,
        fingertip: Fingertip,
        start: tuple[float, float],
    ):
        super().__init__(start)
        arm = rig.arm
        self._start, self._radians = start, arm.radians_per_count
        self._period = rig.controller.sample_period * MM
        self._base = arm.base_x * MM, arm.base_z * MM
        self._lengths = arm.upper_length * MM, arm.lower_length * MM
        height = (rig.key.surface_height + arm.fingertip_radius) * MM
        self._pad = self.pad = Pad(fingertip, key, height)
        self._cubics = [[start[0], 0.0, 0.0, 0.0], [start[1], 0.0, 0.0, 0.0]]
        self._elapsed = 0.0

    def begin_sample(self, reference: Reference, powered: bool, time: float) -> bool:
        """Adopt the reference of a controller sample; see `SteppedFinger`."""
        cubics: Floats = joint_cubics(self._start, *reference(_ENDS), self._radians)[0]
        self._cubics, self._elapsed = cubics.tolist(), 0.0
        first, second = cubics.sum(axis=1).tolist()
        self._joints = first, second
        return False

    def apply_forces(self, elapsed: float, angle: float, omega: float, kick: Kick) -> None:
        """Apply the pad's force; see `SteppedFinger`."""
        self._elapsed = elapsed
        self._pad.press(*self._tip(elapsed), angle, omega, kick)

    def contact_force(self, weight: float) -> float:
        """Return the force [N] on the key at the end of the last step."""
        self._pad.end_step()
        return self._pad.force

    def reaches_key(self, angle: float, step: float) -> bool:
        """Return whether it reaches the key within a step; see `SteppedFinger`."""
        return self.gap(angle, step, step) < 0

    def gap(self, angle: float, time: float, ahead: float) -> float:
        """Return the gap [mm] of a separated pad; see `SteppedFinger`."""
        if not self._pad.separated:
            return math.inf
        x, z = self._tip(self._elapsed + time)[0]
        return self._pad.gap(x, z - self._pad.pin.at(time, ahead), angle)

    def make_contact(self, time: float) -> None:
        """Be in contact with the key from now on."""
        self._pad.make_contact()

    def _tip(self, elapsed: float) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return place [mm] and velocity [mm/ms] of the fingertip's centre at a time [ms]."""
        u = elapsed / self._period
        first, second = (a + u * (b + u * (c + u * d)) for a, b, c, d in self._cubics)
        rate1, rate2 = ((b + u * (2 * c + u * 3 * d)) / self._period for _, b, c, d in self._cubics)
        return fingertip_state(self._base, self._lengths, (first, second), (rate1, rate2))
