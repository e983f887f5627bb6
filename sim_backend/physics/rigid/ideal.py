"""A fingertip exactly at the reference, whatever force acts on it."""

import math

import numpy as np
import pymunk

from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.finger import Reference
from sautereau.sim_backend.physics.rigid.bodies import MM, add_driver, impulse_of
from sautereau.sim_backend.physics.rigid.finger import SteppedFinger
from sautereau.sim_backend.physics.rigid.key import StiffKey
from sautereau.sim_backend.physics.rigid.step_event import Kick
from sautereau.trajectory.arm import fingertip_place
from sautereau.trajectory.key import contact_angle
from sautereau.trajectory.motion import Floats, dot

SETTLING = 4
"""Steps in which an impact ends: it takes two, and the next start with its impulses."""


def touching_angle(rig: Rig, centre: Floats) -> Floats:
    """Return the angles [rad] at which the key touches fingertips centred at (..., 2) [m].

    Raises:
        SceneError: A fingertip is too close to the balance pin for a contact.
    """
    height = rig.key.surface_height + rig.arm.fingertip_radius
    if not dot(centre, centre).min() > height**2:
        raise SceneError(
            f"contact: the fingertip comes within {height * 1e3:.4g} mm of the balance pin, where"
            " no angle of the key gives a contact; start elsewhere, or move arm.base_x"
        )
    return contact_angle(height, centre)


class IdealFinger(SteppedFinger):
    """A fingertip of prescribed motion.

    The key's angle is never below that of contact with the fingertip. In each step a kinematic
    body rotates at the angular velocity that leads to the contact angle, and a unilateral joint
    keeps the key from rotating more slowly.

    Args:
        space: The world.
        key: The key under it.
        rig: The bench.
        start: rad, joints when power comes on.
        steps: Undivided steps in a controller sample.
        cells: Shortest steps in a controller sample.
    """

    def __init__(
        self,
        space: pymunk.Space,
        key: StiffKey,
        rig: Rig,
        start: tuple[float, float],
        steps: int,
        cells: int,
    ):
        super().__init__(start)
        self._rig = rig
        self._start = np.array(start)
        self._body, self._contact = add_driver(space, key.lever)
        cells = max(cells, 4)
        self._per_ms = cells / (rig.controller.sample_period * MM)
        self._fractions = np.arange(cells + math.ceil(cells / steps) + 1) / cells
        self._end = cells
        self._angles: list[float] = []
        self._reaches: list[float] = []
        self._reach, self._struck = 1.0, 0

    def begin_sample(self, reference: Reference, powered: bool, time: float) -> bool:
        """Compute the key's least angle over a controller sample; see `SteppedFinger`."""
        counts, _ = reference(self._fractions)
        key, arm = self._rig.key, self._rig.arm
        joints = self._start + counts * arm.radians_per_count
        place = fingertip_place(arm, joints)
        self._angles = touching_angle(self._rig, place).tolist()
        height = key.surface_height + arm.fingertip_radius
        self._reaches = (np.sqrt(dot(place, place) - height**2) * MM).tolist()
        first, second = joints[self._end].tolist()
        self._joints = (first, second)
        return False

    def apply_forces(self, elapsed: float, angle: float, omega: float, kick: Kick) -> None:
        """Set the least angular velocity of the key; see `SteppedFinger`."""
        ahead, step, _ = kick
        if ahead < step / 4:  # the error is corrected over a quarter step at least
            now = self._least(elapsed)
            least = (self._least(elapsed + ahead) - now) / ahead + (now - angle) / (step / 4)
        else:
            least = (self._least(elapsed + ahead) - angle) / ahead
        self._body.angular_velocity = least
        if least > omega and not self._contact.impulse:
            self._struck = SETTLING
        self.strikes, self._struck = self._struck > 0, self._struck - 1
        cell = min(int(elapsed * self._per_ms + 0.5), len(self._reaches) - 1)
        self._reach = self._reaches[cell]

    def contact_force(self, weight: float) -> float:
        """Return the force [N] on the key; see `SteppedFinger`."""
        return impulse_of(self._contact) / (weight * self._reach)

    def stays_clear(self, angle: float) -> bool:
        """Return whether no contact angle of the sample reaches the key's."""
        return max(self._angles) < angle

    def end_sample(self, angle: float) -> tuple[float, float]:
        """Return the angle, and the overlap [mm] of key and fingertip."""
        return angle, max(0.0, (self._angles[self._end] - angle) * self._reaches[self._end])

    def _least(self, elapsed: float) -> float:
        """Return the least angle [rad] of the key at a time [ms], by cubic interpolation."""
        place = elapsed * self._per_ms
        cell = int(place + 0.5)
        u = place - cell
        angles = self._angles
        if abs(u) < 1e-9:
            return angles[cell]
        first = min(max(int(place) - 1, 0), len(angles) - 4)
        a, b, c, d = angles[first : first + 4]
        u = place - first
        return (
            a * (u - 1) * (u - 2) * (u - 3) / -6
            + b * u * (u - 2) * (u - 3) / 2
            - c * u * (u - 1) * (u - 3) / 2
            + d * u * (u - 1) * (u - 2) / 6
        )
