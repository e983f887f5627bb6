"""Forces between fingertip and key in place of a joint: of a compliant pad, and friction."""

import math

from sautereau.rig.schema import Rig
from sautereau.sim_backend.parts import Fingertip
from sautereau.sim_backend.physics.rigid.bodies import MM, set_force, set_torque
from sautereau.sim_backend.physics.rigid.key import StiffKey
from sautereau.sim_backend.physics.rigid.step_event import Kick

APART = -1e-9  # mm, overlap below which the pad has left the key


class Friction:
    """The friction of the fingertip on the key's surface, in mm, g and ms."""

    def __init__(self, rig: Rig, key: StiffKey):
        self._coefficient, self._radius = rig.arm.fingertip_friction, rig.arm.fingertip_radius * MM
        self._key, self.lever = key, key.lever
        self.height = rig.key.surface_height * MM
        """mm, of the surface above the pin."""

    def part(self, force: float, omega: float, step: float) -> float:
        """Return the force towards the front edge over the force [N] on a key of a rate [1/ms]."""
        # The sign changes over the rate that friction takes or gives in a step [ms]: so that of a
        # key at rest is as large as it must be, or none.
        change = abs(self._coefficient) * self.height * force * step / self.lever.moment
        fastest = max(abs(omega), change)
        return self._coefficient * omega / fastest if fastest else 0.0

    def rub(self, along: float, angle: float) -> tuple[float, float, float]:
        """Apply a force [N]; return the force, (x, z), and moment [N mm] on the fingertip."""
        lever = self.lever
        set_torque(lever, lever.torque + along * self.height)
        sine, cosine = math.sin(angle), math.cos(angle)
        if self._key.sinks:
            set_force(lever, (0.0, lever.force[1] - along * sine))
        return along * cosine, along * sine, along * self._radius


class Pad:
    """The pad on the key's surface, in mm and ms.

    Args:
        height: mm, of the fingertip's centre above the pin where an uncompressed pad touches.
    """

    friction: Friction | None = None

    def __init__(self, fingertip: Fingertip, key: StiffKey, height: float):
        self._stiffness, self._damping = fingertip.stiffness / MM, fingertip.damping
        self._key, self._lever, self._height, self.pin = key, key.lever, height, key.pin
        self.separated = True
        self.force = self.before = 0.0
        """N, on the key, and just before an event there."""
        self._fresh = False

    def gap(self, x: float, z: float, angle: float) -> float:
        """Return the gap [mm] of a fingertip to a key at an angle [rad].

        Args:
            x: mm, of the fingertip's centre.
            z: mm, of it above the pin.
            angle: rad, of the key.
        """
        return z * math.cos(angle) - x * math.sin(angle) - self._height

    def press(
        self,
        place: tuple[float, float],
        velocity: tuple[float, float],
        angle: float,
        omega: float,
        kick: Kick,
    ) -> tuple[float, float, float]:
        """Push the key; return the force [N], (x, z), and moment [N mm] applied to the fingertip.

        Args:
            place: mm, of the fingertip's centre at the end of the step.
            velocity: mm/ms, there.
            angle: rad, of the key there.
            omega: rad/ms, of the key there.
        """
        (x, z), (speed_x, speed_z) = place, velocity
        z, speed_z = z - self.pin.next, speed_z - self.pin.node
        sine, cosine = math.sin(angle), math.cos(angle)
        overlap = -self.gap(x, z, angle)
        reach = -(x * cosine + z * sine)
        closing = speed_x * sine - speed_z * cosine - omega * reach
        self.separated = self.separated or overlap < APART
        push = self._stiffness * overlap + self._damping * closing
        self.force = 0.0 if self.separated else max(0.0, push)
        self.before = 0.0 if self._fresh else self.force
        # A contact in the middle of an impulse: the force acts in the second part only.
        fraction = kick.ahead / (2 * kick.step) if self._fresh else kick.fraction
        applied = self.force * fraction
        set_torque(self._lever, self._lever.torque + applied * reach)
        if self._key.sinks:
            set_force(self._lever, (0.0, self._lever.force[1] - applied * cosine))
        along = 0.0, 0.0, 0.0
        if self.friction is not None:
            part = self.friction.part(self.force, omega, kick.step)
            along = self.friction.rub(applied * part, angle)
        return along[0] - applied * sine, along[1] + applied * cosine, along[2]

    def make_contact(self) -> None:
        """Be in contact with the key from now on."""
        self.separated, self._fresh = False, True

    def end_step(self) -> None:
        """End the step that `press` has prepared."""
        self._fresh = False


def fingertip_state(
    base: tuple[float, float],
    lengths: tuple[float, float],
    joints: tuple[float, float],
    rates: tuple[float, float],
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return place and velocity of the fingertip's centre.

    Args:
        base: mm.
        lengths: mm, of the links.
        joints: rad.
        rates: rad/ms.
    """
    first, total = joints[0], joints[0] + joints[1]
    ux, uz = lengths[0] * math.cos(first), lengths[0] * math.sin(first)
    lx, lz = lengths[1] * math.cos(total), lengths[1] * math.sin(total)
    along = rates[0] + rates[1]
    velocity = -uz * rates[0] - lz * along, ux * rates[0] + lx * along
    return (base[0] + ux + lx, base[1] + uz + lz), velocity
