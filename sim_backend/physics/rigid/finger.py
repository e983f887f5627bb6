"""What presses the key, as the rigid-body engine advances it, with its friction and its pad.

A push without an arm, and fingertips exactly at the reference, whatever force acts on them.
"""

import math
from abc import ABC, abstractmethod
from math import cos, sin

import numpy as np
import pymunk
from pymunk import constraints

from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.parts import Push
from sautereau.sim_backend.physics.finger import Finger, Reference, joint_cubics
from sautereau.sim_backend.physics.rigid.bodies import (
    MM,
    impulse_of,
    set_force,
    set_torque,
    unilateral,
)
from sautereau.sim_backend.physics.rigid.key import Kick, StiffKey
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.key import contact_angle
from sautereau.trajectory.motion import Floats, dot

_ENDS = np.array([0.0, 1.0, 2.0])  # of a controller sample, and of the next
CHECKED = 8  # Equal parts of a sample at whose ends a finger is checked to stay off a key at rest

Pair = tuple[float, float]


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
        sine, cosine = sin(angle), cos(angle)
        if self._key.sinks:
            set_force(lever, (0.0, lever.force[1] - along * sine))
        return along * cosine, along * sine, along * self._radius


class SteppedFinger(Finger, ABC):
    """A finger as the rigid-body engine advances it; mm, g and ms.

    The methods given here are those of a finger without a body in the engine, which presses the
    key through its pad, or not at all.

    Args:
        scene: Its fingertip, and whether there is friction.
        start: rad, joints when power comes on.
    """

    moment: float = 0.0
    """N mm, on the key without a contact."""
    push_end: float = math.inf
    """ms into the controller sample, end of that moment; inf if not within this sample."""

    def __init__(self, key: StiffKey, rig: Rig, scene: Scene, start: Pair):
        self._joints = self._start = start
        self._key, arm = key, rig.arm
        self._period = rig.controller.sample_period * MM
        self._base = arm.base_x * MM, arm.base_z * MM
        self._lengths = arm.upper_length * MM, arm.lower_length * MM
        self._height = (rig.key.surface_height + arm.fingertip_radius) * MM
        """mm, of the fingertip's centre above the surface through the pin, in contact."""
        self.pad = scene.fingertip
        """The pad between a compliant fingertip and the key; None for a rigid fingertip."""
        self.separated, self._fresh = self.pad is not None, False
        pad = self.pad
        self._stiffness, self._damping = (pad.stiffness / MM, pad.damping) if pad else (0.0, 0.0)
        self._pressed = self.before = 0.0
        """N, of the pad on the key, and just before an event there."""
        self.friction = None
        if scene.friction and arm.fingertip_friction:
            self.friction = Friction(rig, key)

    @abstractmethod
    def begin_sample(self, reference: Reference, powered: bool, time: float) -> bool:
        """Start a controller sample at a time [s]; return whether the forces jump there."""

    @abstractmethod
    def apply_forces(self, elapsed: float, angle: float, omega: float, kick: Kick) -> None:
        """Apply the finger's forces to the bodies at the end of a step.

        Args:
            elapsed: ms into the controller sample.
            angle: rad, of the key.
            omega: rad/ms, of the key.
        """

    def contact_force(self, weight: float) -> float:
        """End a step; return the force [N] on the key in it.

        Args:
            weight: ms, for which the forces acted in it.
        """
        self._fresh = False
        return self._pressed

    def retries(self, weight: float) -> bool:
        """Take the friction from the force in a trial of a step; return whether to repeat it."""
        return False

    def foresee(self, force: float) -> None:
        """Take the force [N] of the next step, by which the friction in it is known."""

    def stays_clear(self, angle: float) -> bool:
        """Return whether it stays off a key at an angle [rad] in this controller sample.

        Only a finger without bodies in motion may return True: then no step is taken.
        """
        return False

    def place(self, time: float, ahead: float) -> Pair:
        """Return the place [mm] of the fingertip's centre after a time; see `gap`."""
        first, second = self._joints  # of an arm that stays still
        return self.tip_state(first, first + second)[0]

    def gap(self, angle: float, time: float, ahead: float) -> float:
        """Return the gap [mm] of a separated finger to the key, else inf.

        Args:
            angle: rad, of the key then.
            time: ms from the present position.
            ahead: ms, by half of which the last impulse advanced the velocity.
        """
        if not self.separated:
            return math.inf
        x, z = self.place(time, ahead)
        return self._over(x, z - self._key.pin.at(time, ahead), angle)

    def make_contact(self, time: float) -> None:
        """Be in contact with the key from a time [s] on."""
        self.separated, self._fresh = False, True

    def correct(self, back: float) -> None:
        """Undo the part of the last impulse that acted for a time [ms] too long."""

    def drift(self, step: float) -> None:
        """Compute the end of a step [ms]."""

    def set_bodies(self, step: float) -> None:
        """Set the bodies so that a step [ms] of the engine ends in their target state."""

    def end_sample(self, angle: float) -> Pair:
        """End a controller sample with the key at an angle [rad].

        Returns:
            The contact angle if the finger touches the key, else the angle itself; and the largest
            error [mm] of a joint or a contact.
        """
        return angle, 0.0

    def tip_state(self, upper: float, lower: float, rate1: float = 0, rate2: float = 0):
        """Return place [mm] and velocity [mm/ms] of the fingertip's centre.

        Args:
            upper: rad, absolute angle of link 1; its rate [rad/ms] is `rate1`.
            lower: rad, absolute angle of link 2.
        """
        (x, z), (l1, l2) = self._base, self._lengths
        ux, uz, lx, lz = (
            l1 * cos(upper),
            l1 * sin(upper),
            l2 * cos(lower),
            l2 * sin(lower),
        )
        return (x + ux + lx, z + uz + lz), (-uz * rate1 - lz * rate2, ux * rate1 + lx * rate2)

    def press_pad(
        self, place: Pair, velocity: Pair, angle: float, omega: float, kick: Kick
    ) -> tuple[float, float, float]:
        """Push the key; return the force [N], (x, z), and moment [N mm] applied to the fingertip.

        Args:
            place: mm, of the fingertip's centre at the end of the step.
            velocity: mm/ms, there.
            angle: rad, of the key there.
            omega: rad/ms, of the key there.
        """
        (x, z), (speed_x, speed_z), key = place, velocity, self._key
        z, speed_z = z - key.pin.next, speed_z - key.pin.node
        sine, cosine = sin(angle), cos(angle)
        overlap = -self._over(x, z, angle)
        reach = -(x * cosine + z * sine)
        closing = speed_x * sine - speed_z * cosine - omega * reach
        # mm, a pad with a smaller overlap has left the key.
        self.separated = self.separated or overlap < -1e-9
        push = self._stiffness * overlap + self._damping * closing
        self._pressed = 0.0 if self.separated else max(0.0, push)
        self.before = 0.0 if self._fresh else self._pressed
        # A contact in the middle of an impulse: the force acts in the second part only.
        fraction = kick.ahead / (2 * kick.step) if self._fresh else kick.fraction
        applied, lever = self._pressed * fraction, key.lever
        set_torque(lever, lever.torque + applied * reach)
        if key.sinks:
            set_force(lever, (0.0, lever.force[1] - applied * cosine))
        along = 0.0, 0.0, 0.0
        if self.friction is not None:
            part = self.friction.part(self._pressed, omega, kick.step)
            along = self.friction.rub(applied * part, angle)
        return along[0] - applied * sine, along[1] + applied * cosine, along[2]

    def _over(self, x: float, z: float, angle: float) -> float:
        """Return the height [mm] of a fingertip at (x, z) from the pin over contact with a key."""
        return z * cos(angle) - x * sin(angle) - self._height


class PushFinger(SteppedFinger):
    """A force on the key from the first instant on; the arm is not simulated and stays still."""

    def __init__(self, key: StiffKey, rig: Rig, scene: Scene, start: Pair, push: Push):
        super().__init__(key, rig, scene, start)
        self._push, self._arm = push, rig.key.press_arm * MM

    def begin_sample(self, reference: Reference, powered: bool, time: float) -> bool:
        before, left = self.moment, (self._push.duration - time) * MM
        on = powered and left > 1e-9 * self._period
        self.moment = self._push.force * self._arm if on else 0.0
        self.push_end = left if on and left < self._period * (1 - 1e-9) else math.inf
        return self.moment != before

    def apply_forces(self, elapsed: float, angle: float, omega: float, kick: Kick) -> None:
        """Apply the friction; see `SteppedFinger`."""
        if self.friction is not None:
            force = self.contact_force(0.0)
            part = self.friction.part(force, omega, kick.step)
            self.friction.rub(force * part * kick.fraction, angle)

    def contact_force(self, weight: float) -> float:
        return self.moment / self._arm


class PaddedIdealFinger(SteppedFinger):
    """A fingertip whose joints follow the reference exactly, with a pad."""

    def __init__(self, key: StiffKey, rig: Rig, scene: Scene, start: Pair):
        super().__init__(key, rig, scene, start)
        self._radians = rig.arm.radians_per_count
        still = [[angle, 0.0, 0.0, 0.0] for angle in start]
        self._cubics = [still, still]
        self._elapsed = 0.0

    def begin_sample(self, reference: Reference, powered: bool, time: float) -> bool:
        """Adopt the reference of a controller sample and of the next; see `SteppedFinger`."""
        self._cubics = joint_cubics(self._start, *reference(_ENDS), self._radians).tolist()
        first, second = map(sum, self._cubics[0])
        self._joints, self._elapsed = (first, second), 0.0
        return False

    def tip(self, elapsed: float) -> tuple[Pair, Pair]:
        """Return place [mm] and velocity [mm/ms] of the fingertip's centre at a time [ms]."""
        u = elapsed / self._period
        cubics = self._cubics[u > 1]
        u -= u > 1
        (a, b, c, d), (e, f, g, h) = cubics
        first, second = a + u * (b + u * (c + u * d)), e + u * (f + u * (g + u * h))
        rate1 = (b + u * (2 * c + u * 3 * d)) / self._period
        rate2 = (f + u * (2 * g + u * 3 * h)) / self._period
        return self.tip_state(first, first + second, rate1, rate1 + rate2)

    def place(self, time: float, ahead: float) -> Pair:
        return self.tip(self._elapsed + time)[0]

    def apply_forces(self, elapsed: float, angle: float, omega: float, kick: Kick) -> None:
        """Apply the pad's force; see `SteppedFinger`."""
        self._elapsed = elapsed
        self.press_pad(*self.tip(elapsed), angle, omega, kick)


class IdealFinger(PaddedIdealFinger):
    """A rigid fingertip of prescribed motion.

    The key's angle is never below that of contact with the fingertip. In each step a kinematic
    body rotates at the angular velocity that leads to the contact angle, and a unilateral joint
    keeps the key from rotating more slowly.
    """

    def __init__(self, space: pymunk.Space, key: StiffKey, rig: Rig, scene: Scene, start: Pair):
        super().__init__(key, rig, scene, start)
        self._force = 0.0
        self._body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        self._contact = constraints.RotaryLimitJoint(self._body, key.lever, math.inf, math.inf)
        space.add(self._body, unilateral(self._contact))
        self._reach = 1.0
        self._next = math.nan, 0.0  # ms and mm, end of the next step and the contact's arm there

    def begin_sample(self, reference: Reference, powered: bool, time: float) -> bool:
        self._next = math.nan, 0.0
        return super().begin_sample(reference, powered, time)

    def apply_forces(self, elapsed: float, angle: float, omega: float, kick: Kick) -> None:
        """Set the least angular velocity of the key; see `SteppedFinger`."""
        ahead, step, _ = kick
        self._elapsed = elapsed
        then, reach = self._next
        self._reach = reach if abs(then - elapsed) < 1e-9 else self._touching(elapsed)[1]  # ms
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
        self._contact.max_force = 0.0 if self.separated else math.inf

    def contact_force(self, weight: float) -> float:
        self._force = impulse_of(self._contact) / (weight * self._reach)
        self.separated = not self._force > 0
        return self._force

    def stays_clear(self, angle: float) -> bool:
        """Return whether no contact angle of the sample reaches the key's."""
        times = (self._period * n / CHECKED for n in range(CHECKED + 1))
        return all(self._touching(time)[0] < angle for time in times)

    def end_sample(self, angle: float) -> Pair:
        """Return the angle, and the overlap [mm] of key and fingertip."""
        least, reach = self._touching(self._period)
        return angle, max(0.0, (least - angle) * reach)

    def _touching(self, elapsed: float) -> Pair:
        """Return the least angle [rad] of the key at a time [ms], and the contact's arm [mm]."""
        (x, z), _ = self.tip(elapsed)
        squared = x * x + z * z - self._height**2
        if not squared > 0:
            raise _at_pin(self._height / MM)
        reach = math.sqrt(squared)
        return math.atan2(-x, z) - math.atan2(reach, self._height), reach


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
