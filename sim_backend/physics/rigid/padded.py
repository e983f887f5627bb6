"""A fingertip of prescribed motion with a compliant pad."""

import math

from sautereau.rig.schema import Rig
from sautereau.sim_backend.parts import Fingertip
from sautereau.sim_backend.physics.finger import Reference
from sautereau.sim_backend.physics.rigid.key import StiffKey
from sautereau.sim_backend.physics.rigid.pad import Pad
from sautereau.sim_backend.physics.rigid.prescribed import PrescribedFinger
from sautereau.sim_backend.physics.rigid.step_event import Kick


class PaddedIdealFinger(PrescribedFinger):
    """A fingertip of prescribed motion with a pad.

    Args:
        start: rad, joints when power comes on.
    """

    def __init__(self, key: StiffKey, rig: Rig, fingertip: Fingertip, start: tuple[float, float]):
        super().__init__(rig, start)
        self._pad = self.pad = Pad(fingertip, key, self._height)
        self._elapsed = 0.0

    def begin_sample(self, reference: Reference, powered: bool, time: float) -> bool:
        self._elapsed = 0.0
        return super().begin_sample(reference, powered, time)

    def apply_forces(self, elapsed: float, angle: float, omega: float, kick: Kick) -> None:
        """Apply the pad's force; see `SteppedFinger`."""
        self._elapsed = elapsed
        self._pad.press(*self.tip(elapsed), angle, omega, kick)

    def contact_force(self, weight: float) -> float:
        self._pad.end_step()
        return self._pad.force

    def reaches_key(self, angle: float, step: float) -> bool:
        return self.gap(angle, step, step) < 0

    def gap(self, angle: float, time: float, ahead: float) -> float:
        if not self._pad.separated:
            return math.inf
        x, z = self.tip(self._elapsed + time)[0]
        return self._pad.gap(x, z - self._pad.pin.at(time, ahead), angle)

    def make_contact(self, time: float) -> None:
        self._pad.make_contact()
