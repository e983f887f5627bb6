"""A fingertip exactly at the reference, whatever force acts on it."""

import math

import pymunk

from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.finger import Reference
from sautereau.sim_backend.physics.rigid.bodies import MM, add_driver, impulse_of
from sautereau.sim_backend.physics.rigid.key import StiffKey
from sautereau.sim_backend.physics.rigid.prescribed import PrescribedFinger
from sautereau.sim_backend.physics.rigid.step_event import Kick
from sautereau.trajectory.key import contact_angle
from sautereau.trajectory.motion import Floats, dot

CHECKED = 8
"""Equal parts of a sample at whose ends a finger is checked to stay off a key at rest."""
SAME = 1e-9
"""ms, below which two times are the same."""
SETTLING = 4
"""Steps in which an impact ends: it takes two, and the next start with its impulses."""


def touching_angle(rig: Rig, centre: Floats) -> Floats:
    """Return the angles [rad] at which the key touches fingertips centred at (..., 2) [m].

    Raises:
        SceneError: A fingertip is too close to the balance pin for a contact.
    """
    height = rig.key.surface_height + rig.arm.fingertip_radius
    if not dot(centre, centre).min() > height**2:
        raise _at_pin(height)
    return contact_angle(height, centre)


def _at_pin(height: float) -> SceneError:
    return SceneError(
        f"contact: the fingertip comes within {height * 1e3:.4g} mm of the balance pin, where"
        " no angle of the key gives a contact; start elsewhere, or move arm.base_x"
    )


class IdealFinger(PrescribedFinger):
    """A fingertip of prescribed motion.

    The key's angle is never below that of contact with the fingertip. In each step a kinematic
    body rotates at the angular velocity that leads to the contact angle, and a unilateral joint
    keeps the key from rotating more slowly.

    Args:
        start: rad, joints when power comes on.
    """

    def __init__(self, space: pymunk.Space, key: StiffKey, rig: Rig, start: tuple[float, float]):
        super().__init__(rig, start)
        self._body, self._contact = add_driver(space, key.lever)
        self._reach, self._struck = 1.0, 0
        self._next = math.nan, 0.0
        """ms and mm, end of the next step and the contact's arm there."""

    def begin_sample(self, reference: Reference, powered: bool, time: float) -> bool:
        self._next = math.nan, 0.0
        return super().begin_sample(reference, powered, time)

    def apply_forces(self, elapsed: float, angle: float, omega: float, kick: Kick) -> None:
        """Set the least angular velocity of the key; see `SteppedFinger`."""
        ahead, step, _ = kick
        then, reach = self._next
        self._reach = reach if abs(then - elapsed) < SAME else self._touching(elapsed)[1]
        angle_ahead, reach = self._touching(elapsed + ahead)
        self._next = elapsed + ahead, reach
        if ahead < step / 4:  # the error is corrected over a quarter step at least
            now = self._touching(elapsed)[0]
            least = (angle_ahead - now) / ahead + (now - angle) / (step / 4)
        else:
            least = (angle_ahead - angle) / ahead
        self._body.angular_velocity = least
        if least > omega and not self._contact.impulse:
            self._struck = SETTLING
        self.strikes, self._struck = self._struck > 0, self._struck - 1

    def contact_force(self, weight: float) -> float:
        return impulse_of(self._contact) / (weight * self._reach)

    def stays_clear(self, angle: float) -> bool:
        """Return whether no contact angle of the sample reaches the key's."""
        times = (self._period * n / CHECKED for n in range(CHECKED + 1))
        return all(self._touching(time)[0] < angle for time in times)

    def end_sample(self, angle: float) -> tuple[float, float]:
        """Return the angle, and the overlap [mm] of key and fingertip."""
        least, reach = self._touching(self._period)
        return angle, max(0.0, (least - angle) * reach)

    def _touching(self, elapsed: float) -> tuple[float, float]:
        """Return the least angle [rad] of the key at a time [ms], and the contact's arm [mm]."""
        u = elapsed / self._period
        first, second = self._cubics[u > 1]
        u -= u > 1
        upper = first[0] + u * (first[1] + u * (first[2] + u * first[3]))
        lower = upper + second[0] + u * (second[1] + u * (second[2] + u * second[3]))
        (x, z), (l1, l2) = self._base, self._lengths
        x += l1 * math.cos(upper) + l2 * math.cos(lower)
        z += l1 * math.sin(upper) + l2 * math.sin(lower)
        squared = x * x + z * z - self._height**2
        if not squared > 0:
            raise _at_pin(self._height / MM)
        reach = math.sqrt(squared)
        return math.atan2(-x, z) - math.atan2(reach, self._height), reach
