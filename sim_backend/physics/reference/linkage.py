"""The two links and the key under their fingertip, in plain floats."""

import math
from typing import NamedTuple

from sautereau.rig.schema import Rig
from sautereau.rig.section import GRAVITY
from sautereau.sim_backend.errors import SceneError


class KeyUnderFingertip(NamedTuple):
    """The key in contact with the fingertip: a(q), a' = A q', a'' = A q'' + bias."""

    angle: float
    """rad."""
    angular_velocity: float
    """rad/s."""
    slope1: float
    slope2: float
    """Dimensionless, A of joints 1 and 2."""
    bias: float
    """rad/s^2, bias acceleration, due to the joints' velocities."""
    lever: float
    """m, moment about the pin per newton along the key's normal."""


class Inertia(NamedTuple):
    """M q'' = motors - load, at one position of the arm."""

    m11: float
    m12: float
    m22: float
    """kg m^2."""
    load1: float
    load2: float
    """N m, weight and centrifugal torques."""

    def solve(self, right1: float, right2: float) -> tuple[float, float]:
        """Return M^-1 right."""
        size = self.m11 * self.m22 - self.m12 * self.m12
        return (
            (right1 * self.m22 - right2 * self.m12) / size,
            (right2 * self.m11 - right1 * self.m12) / size,
        )


class Linkage:
    """Kinematics and dynamics of the arm; equations as in `sautereau.trajectory.dynamics`."""

    def __init__(self, rig: Rig):
        arm = self.arm = rig.arm
        self.name = rig.name
        self.height = rig.key.surface_height + arm.fingertip_radius
        (rotor1, rotor2), (gear1, gear2) = arm.rotor_inertias, arm.gear_ratios
        l1, l2, mass1, mass2 = arm.upper_length, arm.lower_length, arm.upper_mass, arm.lower_mass
        self._upper = (mass1 / 3 + mass2) * l1**2 + rotor1 * gear1**2
        self._lower = mass2 * l2**2 / 3
        self._second = rotor2 * gear2**2
        self._coupling = mass2 * l1 * l2 / 2
        self._weight1 = GRAVITY * (mass1 / 2 + mass2) * l1
        self._weight2 = GRAVITY * mass2 * l2 / 2

    def weight(self, q1: float, q2: float) -> tuple[float, float]:
        """Return the torques [N m] that balance the links' weight."""
        second = self._weight2 * math.cos(q1 + q2)
        return self._weight1 * math.cos(q1) + second, second

    def inertia(self, q1: float, q2: float, d1: float, d2: float) -> Inertia:
        """Return the arm's equation at joints [rad] and their speeds [rad/s]."""
        coupling = self._coupling * math.cos(q2)
        twist = self._coupling * math.sin(q2)
        weight1, weight2 = self.weight(q1, q2)
        return Inertia(
            self._upper + self._lower + 2 * coupling,
            self._lower + coupling,
            self._lower + self._second,
            weight1 - twist * (2 * d1 + d2) * d2,
            weight2 + twist * d1 * d1,
        )

    def key_under_fingertip(self, q1: float, q2: float, d1: float, d2: float) -> KeyUnderFingertip:
        """Return the key under the fingertip: z cos a - x sin a = hf + r.

        Raises:
            SceneError: The fingertip is so close to the pin that no angle gives a contact.
        """
        arm, height, total = self.arm, self.height, q1 + q2
        ux, uz = arm.upper_length * math.cos(q1), arm.upper_length * math.sin(q1)
        lx, lz = arm.lower_length * math.cos(total), arm.lower_length * math.sin(total)
        x, z = arm.base_x + ux + lx, arm.base_z + uz + lz
        squared = x * x + z * z - height * height
        if squared <= 0:
            raise SceneError(
                f"rig {self.name}: the fingertip comes within {height * 1e3:.4g} mm of the balance"
                " pin, where no angle gives a contact; lower the servo's gains or the speed"
            )
        angle = math.atan2(-x, z) - math.atan2(math.sqrt(squared), height)
        sine, cosine = math.sin(angle), math.cos(angle)
        reach = x * cosine + z * sine
        # Columns of the fingertip's Jacobian: (-uz - lz, ux + lx) and (-lz, lx).
        slope1 = ((uz + lz) * sine + (ux + lx) * cosine) / reach
        slope2 = (lz * sine + lx * cosine) / reach
        omega = slope1 * d1 + slope2 * d2
        both = d1 + d2
        along = (-uz * d1 - lz * both) * cosine + (ux * d1 + lx * both) * sine
        inward = (ux * d1 * d1 + lx * both * both) * sine - (
            uz * d1 * d1 + lz * both * both
        ) * cosine
        bias = (inward - 2 * omega * along - omega * omega * height) / reach
        return KeyUnderFingertip(angle, omega, slope1, slope2, bias, -reach)
