"""Fingertips exactly at the reference, whatever force acts on them: rigid, or with a pad."""

import math

import numpy as np
import pymunk

from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.parts import Fingertip
from sautereau.sim_backend.physics.finger import Reference, joint_cubics
from sautereau.sim_backend.physics.rigid.bodies import MM, add_driver, impulse_of
from sautereau.sim_backend.physics.rigid.finger import SteppedFinger
from sautereau.sim_backend.physics.rigid.key import StiffKey
from sautereau.sim_backend.physics.rigid.pad import Pad, fingertip_state
from sautereau.sim_backend.physics.rigid.step_event import Kick
from sautereau.trajectory.key import contact_angle
from sautereau.trajectory.motion import Floats, dot

CHECKED = 8  # Equal parts of a sample at whose ends a finger is checked to stay off a key at rest
SAME = 1e-9  # ms, below which two times are the same
_ENDS = np.array([0.0, 1.0, 2.0])  # of a controller sample, and of the next


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
        self._force = 0.0
        self._body, self._contact = add_driver(space, key.lever)
        self._reach, self._elapsed, self._separated = 1.0, 0.0, False
        self._next = math.nan, 0.0  # ms and mm, end of the next step and the contact's arm there

    def begin_sample(self, reference: Reference, powered: bool, time: float) -> bool:
        self._next, self._elapsed = (math.nan, 0.0), 0.0
        return super().begin_sample(reference, powered, time)

    def apply_forces(self, elapsed: float, angle: float, omega: float, kick: Kick) -> None:
        """Set the least angular velocity of the key; see `SteppedFinger`."""
        ahead, step, _ = kick
        self._elapsed = elapsed
        then, reach = self._next
        self._reach = reach if abs(then - elapsed) < SAME else self._touching(elapsed)[1]
        if self.friction is not None:  # the moment per force
            part = self.friction.part(self._force, omega, step)
            self._reach += part * self.friction.height
        angle_ahead, reach = self._touching(elapsed + ahead)
        self._next = elapsed + ahead, reach
        if ahead < step / 4:  # the error is corrected over a quarter step at least
            now = self._touching(elapsed)[0]
            least = (angle_ahead - now) / ahead + (now - angle) / (step / 4)
        else:
            least = (angle_ahead - angle) / ahead
        self._body.angular_velocity = least
        self._contact.max_force = 0.0 if self._separated else math.inf

    def contact_force(self, weight: float) -> float:
        self._force = impulse_of(self._contact) / (weight * self._reach)
        self._separated = not self._force > 0
        return self._force

    def reaches_key(self, angle: float, step: float) -> bool:
        return self.gap(angle, step, step) < 0

    def gap(self, angle: float, time: float, ahead: float) -> float:
        if not self._separated:
            return math.inf
        least, reach = self._touching(self._elapsed + time)
        return (angle - least) * reach

    def make_contact(self, time: float) -> None:
        self._separated = False

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
