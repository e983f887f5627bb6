"""The two links of the arm under the controller's position loops."""

import math

import numpy as np
import pymunk
from pymunk.constraints import SlideJoint

from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.parts import Joints
from sautereau.sim_backend.physics.finger import LoopedFinger, Reference
from sautereau.sim_backend.physics.laws import close_loop
from sautereau.sim_backend.physics.parameters import finger_of
from sautereau.sim_backend.physics.rigid import bodies
from sautereau.sim_backend.physics.rigid.bodies import FAR, MM
from sautereau.sim_backend.physics.rigid.finger import Pair, SteppedFinger, touching_angle
from sautereau.sim_backend.physics.rigid.key import Coordinate, Kick, StiffKey
from sautereau.sim_backend.physics.structures import as_objects
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.dynamics import armature, mass_matrix

_ENDS = np.array([0.0, 1.0])


class Motor(Coordinate):
    """The motor of one joint behind a gear with backlash, which its encoder sees: mm, g and ms.

    J theta'' = torque - c theta' - f sgn(theta') - T, and the link has T, with the wind-up
    e = theta - q beyond half the backlash to either side: T = k e + d (theta' - q'), where that
    pushes in the direction of e, else 0. The rotation of the rotor with link 1 is neglected, as
    in `trajectory.dynamics`.

    Args:
        joint: From 0.
        inertia: kg m^2, of the rotor at the joint.
        angle: rad, at the start.
    """

    def __init__(self, joints: Joints, joint: int, inertia: float, angle: float):
        super().__init__(angle)
        self._inertia = inertia * bodies.INERTIA
        self._half = joints.backlash[joint] / 2
        self._stiffness = joints.gear_stiffness[joint] * MM
        self._damping = joints.gear_damping[joint] * MM**2
        self._dry = joints.dry_friction[joint] * MM
        self._viscous = joints.viscous_friction[joint] * MM**2
        self._next_speed = 0.0

    def rate(self, mobility: float) -> float:
        """Return the rate [1/ms] of the gear's oscillation or decay.

        Args:
            mobility: 1 / (g mm^2), of the link.
        """
        both = mobility + 1 / self._inertia
        return max(math.sqrt(self._stiffness * both), self._damping * both)

    def drive(self, torque: float, kick: Kick, link: float, link_rate: float) -> float:
        """Prepare the end of a step; return the torque [N mm] on the link in it.

        Args:
            torque: N mm, of the motor in the step.
            link: rad, angle of the joint at its end.
            link_rate: rad/ms.
        """
        wound = self.next - link
        wound -= max(-self._half, min(self._half, wound))
        passed = 0.0
        if wound:
            push = self._stiffness * wound + self._damping * (self.speed - link_rate)
            passed = push * kick.fraction if push * wound > 0 else 0.0
        time = kick.step / self._inertia
        rate = self.speed + (torque - passed) * time
        rate /= 1 + self._viscous * kick.fraction * time
        held = self._dry * kick.fraction * time
        self._next_speed = math.copysign(max(0.0, abs(rate) - held), rate)
        return passed

    def hold(self) -> None:
        """Be at rest, as with its brake on."""
        self.speed = self.acceleration = 0.0

    def end_step(self, weight: float) -> None:
        """End the step that `drive` has prepared, in which the forces acted for a weight [ms]."""
        self.advance(self._next_speed, weight)


class ServoFinger(LoopedFinger, SteppedFinger):
    """Two links, their motors under the controller's position loops.

    Link 1 rotates with joint 1 and carries its armature inertia. The armature of joint 2 resists
    the relative rotation of the two links, which no rigid body can represent. Behind backlash a
    motor has an angle of its own.

    Args:
        start: rad, joints when power comes on.
        scene: With its servo, gravity, joints and fingertip.

    Raises:
        SceneError: The motor of joint 2 has a rotor without backlash, or one with it has none.
    """

    def __init__(
        self, space: pymunk.Space, key: StiffKey, rig: Rig, scene: Scene, start: tuple[float, float]
    ):
        (loops,) = as_objects(finger_of(rig, scene, start))
        LoopedFinger.__init__(self, loops, rig.arm, scene.gravity)
        SteppedFinger.__init__(self, key, rig, scene, start)
        first, second = rotors = armature(rig.arm)
        joints = scene.joints or Joints()
        loose = [backlash > 0 for backlash in joints.backlash]
        if second > 0 and not loose[1]:
            raise SceneError(
                f"arm.rotor_inertias: joint 2's rotor adds {second:.4g} kg m^2 to its joint, and a"
                f' servo scene models the rotor of joint 1 alone; set it to "0 kg m^2" in the'
                ' scene\'s table [truth] or in the rig, or take finger = "ideal"'
            )
        for joint, (rotor, is_loose) in enumerate(zip(rotors, loose, strict=True), 1):
            if is_loose and not rotor:
                raise SceneError(
                    f"joints.backlash: the motor of joint {joint} moves alone in it, and"
                    " arm.rotor_inertias gives it no inertia; give it in the scene's table [truth]"
                    " or in the rig"
                )
        self._rig, self._space = rig, space
        self._bodies = upper, lower = bodies.add_arm(space, rig.arm, start)
        self.links = Coordinate(upper.angle), Coordinate(lower.angle)
        """Absolute angles of both links."""
        self._moving: tuple[Coordinate, ...] = self.links
        upper.moment += (not loose[0]) * first * bodies.INERTIA
        self._motors = [
            Motor(joints, j, rotors[j], start[j]) if loose[j] else None for j in range(2)
        ]
        self._loose = [motor for motor in self._motors if motor is not None]
        self.dry: bodies.Dry = [
            bodies.add_friction(space, joint, force * MM)
            for joint, force, motor in zip(
                bodies.brakes(space, *self._bodies), joints.dry_friction, self._motors, strict=True
            )
            if force and motor is None
        ]
        """Dry friction of the joints whose motors turn with the links."""
        self._viscous = [0.0 if loose[j] else joints.viscous_friction[j] * MM**2 for j in range(2)]
        if self.pad is None:
            behind, end = (-rig.key.press_arm * MM, self._height + FAR), (self._lengths[1] / 2, 0)
            self._tip = SlideJoint(key.lever, lower, behind, end, 0, FAR - bodies.REACH)
            space.add(bodies.unilateral(self._tip))
        self._brakes = bodies.brakes(space, *self._bodies)
        space.add(*self._brakes)
        self._driven = scene.joints is not None
        self._force = self._foreseen = 0.0
        self._rate: float | None = None  # of the key after a trial of a step, in which it may jump
        self._torque = self._correction = 0.0, 0.0
        self._before, self._drifted = [body.position for body in self._bodies], 0.0

    def joints(self) -> tuple[float, float]:
        first, second = self._motors
        q1 = self.links[0].value
        q2 = self.links[1].value - q1
        return q1 if first is None else first.value, q2 if second is None else second.value

    @property
    def gear_rate(self) -> float:
        """Rate [1/ms] of the fastest oscillation or decay of a gear; 0 without backlash."""
        # The links are lightest at a joint where the other one is free: diag(M^-1).
        joints = np.array([[0.0, angle] for angle in (0.0, math.pi / 2, math.pi)])
        bare = self._rig.arm.model_copy(update={"rotor_inertias": (0.0, 0.0)})
        yielding = np.linalg.inv(mass_matrix(bare, joints)) / bodies.INERTIA
        mobility = np.diagonal(yielding, axis1=1, axis2=2).max(axis=0)
        rates = (motor.rate(float(mobility[j])) for j, motor in enumerate(self._motors) if motor)
        return max(rates, default=0.0)

    def block(self, joint: int) -> None:
        self._space.add(bodies.brakes(self._space, *self._bodies)[joint])

    def begin_sample(self, reference: Reference, powered: bool, time: float) -> bool:
        """Read the encoders and set the torques for a controller sample; see `SteppedFinger`."""
        jumped = self.switch(powered)
        if jumped:
            (self._space.remove if powered else self._space.add)(*self._brakes)
            self._moving = *self.links, *self._loose * powered
            for motor in self._loose:
                motor.hold()
        before = self._torque
        if powered:
            counts, speeds = reference(_ENDS)
            (asked, _), (now, then) = counts.tolist(), speeds.tolist()
            radians, period = self._loops.radians, self._period / MM
            for j, angle in enumerate(self.joints()):
                lag = (asked[j] - round((angle - self._start[j]) / radians)) * radians
                acceleration = (then[j] - now[j]) * radians / period**2
                close_loop(self._loops, j, lag, acceleration, period)
        first, second = self.torques()
        self._torque = first * MM, second * MM
        if not jumped:  # half of the last impulse belongs to this sample but used the old torque
            (first, second), (a, b) = self._torque, before
            self._correction = (first - a) / 2, (second - b) / 2
        return jumped

    def apply_forces(self, elapsed: float, angle: float, omega: float, kick: Kick) -> None:
        """Apply the motors' torques and the pad's force; see `SteppedFinger`."""
        (first, second), (a, b) = self._torque, self._correction
        first, second = first * kick.fraction + a, second * kick.fraction + b
        if self._driven:
            first, second = self._through_joints((first, second), kick)
        x = z = moment = 0.0
        upper, lower = self._bodies
        if self.pad is not None or self.friction is not None:
            q1, q2 = (link.next for link in self.links)
            if self.pad is not None:
                rates = [link.node for link in self.links]
                x, z, moment = self.press_pad(*self.tip_state(q1, q2, *rates), angle, omega, kick)
            elif self.friction is not None:
                rate = omega if self._rate is None else self._rate
                part = self.friction.part(self._force, rate, kick.step)  # no blow's force
                x, z, moment = self.friction.rub(self._foreseen * part * kick.fraction, angle)
            bodies.set_force(lower, (x, z))
            moment += self._lengths[1] / 2 * (math.cos(q2) * z - math.sin(q2) * x)
        bodies.set_torque(lower, second + moment)
        bodies.set_torque(upper, first - second)

    def _through_joints(self, torques: Pair, kick: Kick) -> Pair:
        """Return the torques [N mm] on the links, by the motors' ones in a step."""
        (q1, w1), (q2, w2) = ((link.next, link.speed) for link in self.links)
        places, rates, passed = (q1, q2 - q1), (w1, w2 - w1), [0.0, 0.0]
        for j, motor in enumerate(self._motors):
            if motor is None:
                passed[j] = torques[j] - self._viscous[j] * rates[j] * kick.fraction
            elif self._powered:
                passed[j] = motor.drive(torques[j], kick, places[j], rates[j])
        return passed[0], passed[1]

    def retries(self, weight: float) -> bool:
        if self.friction is None or self.pad is not None or self.separated:
            return False
        before, self._foreseen = self._foreseen, max(0.0, self._tip.impulse / weight)
        self._rate = bodies.angular_velocity_of(self.friction.lever)
        return abs(self._foreseen - before) > 1e-9 * (1 + before)

    def foresee(self, force: float) -> None:
        self._force = self._foreseen = force

    def contact_force(self, weight: float) -> float:
        self._correction, self._rate = (0.0, 0.0), None
        if self._powered:
            for motor in self._loose:
                motor.end_step(weight)
        (first, second), (upper, lower) = self.links, self._bodies
        # The angles have what the joints have corrected.
        first.next, second.next = bodies.angle_of(upper), bodies.angle_of(lower)
        first.advance(bodies.angular_velocity_of(upper), weight)
        second.advance(bodies.angular_velocity_of(lower), weight)
        if self.pad is not None or self.separated:
            return super().contact_force(weight)
        force = self._tip.impulse / weight
        if not force > 0:
            self.separated = True
            self._tip.max = 2 * FAR
        self._foreseen, self._force = max(0.0, 2 * force - self._force), force
        return force

    def place(self, time: float, ahead: float) -> Pair:
        return self.tip_state(*(link.at(time, ahead) for link in self.links))[0]

    def make_contact(self, time: float) -> None:
        super().make_contact(time)
        if self.pad is None:
            self._tip.max = FAR - bodies.REACH

    def correct(self, back: float) -> None:
        self._before = [body.position for body in self._bodies]
        for each in self._moving:
            each.correct(back)

    def drift(self, step: float) -> None:
        self._drifted = step
        for each in self._moving:
            each.drift(step)

    def set_bodies(self, step: float) -> None:
        x = z = 0.0  # speeds of the end of the link before
        parts = zip(self._bodies, self.links, self._lengths, self._before, strict=True)
        for body, link, length, before in parts:
            rate = length / 2 * link.speed
            across, up = -rate * math.sin(link.value), rate * math.cos(link.value)
            body.velocity = velocity = pymunk.Vec2d(x + across, z + up)
            body.position = before + (self._drifted - step) * velocity
            body.angle, body.angular_velocity = link.next - link.speed * step, link.speed
            x, z = x + 2 * across, z + 2 * up

    def end_sample(self, angle: float) -> Pair:
        (x, z), (l1, l2) = self._base, self._lengths
        worst = 0.0
        for body, length in zip(self._bodies, (l1, l2), strict=True):
            half_x, half_z = length / 2 * math.cos(body.angle), length / 2 * math.sin(body.angle)
            (at_x, at_z) = body.position
            worst = max(worst, math.hypot(at_x - half_x - x, at_z - half_z - z))
            x, z = at_x + half_x, at_z + half_z
        if self.pad is not None:
            return angle, worst
        gap = self._over(x, z - self._key.pin.value, angle)
        if gap < 0 or (not self.separated and gap < bodies.REACH):
            tip = np.array([x, z - self._key.pin.value]) / MM
            angle = float(touching_angle(self._rig, tip))
        return angle, max(worst, -gap)
