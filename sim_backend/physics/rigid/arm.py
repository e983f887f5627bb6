"""The two links of the arm under the controller's position loops."""

import math

import numpy as np
import pymunk

from sautereau.rig.schema import Arm, Rig
from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.parts import Joints, Servo
from sautereau.sim_backend.physics.finger import Reference, settled_within
from sautereau.sim_backend.physics.rigid import bodies
from sautereau.sim_backend.physics.rigid.finger import SteppedFinger
from sautereau.sim_backend.physics.rigid.ideal import touching_angle
from sautereau.sim_backend.physics.rigid.key import StiffKey
from sautereau.sim_backend.physics.rigid.motor import Motor
from sautereau.sim_backend.physics.rigid.pad import Pad, fingertip_state
from sautereau.sim_backend.physics.rigid.step_event import Kick
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.dynamics import armature, gravity_torque, mass_matrix

_ENDS = np.array([0.0, 1.0])


class PositionLoops:
    """Compute the torque of each joint from reference and encoder, once per sample."""

    def __init__(self, servo: Servo, arm: Arm, period: float, gravity: float = GRAVITY):
        self.servo = servo
        self.arm = arm
        self.period = period
        self._gravity = gravity
        self.radians = arm.radians_per_count
        self.offsets = (0.0, 0.0)
        """N m, added to the loops' torques."""
        self.limits = (arm.torque_limit, arm.torque_limit)
        """N m, of the controller; the motors have limits of their own."""
        self._integral = [0.0, 0.0]
        self._last = [0.0, 0.0]

    def engage(self, joints: tuple[float, float]) -> None:
        """Take over an arm at rest: the integrators start at the torques of its weight."""
        weight = gravity_torque(self.arm, np.array(joints)) * (self._gravity / GRAVITY)
        self._integral = weight.tolist()
        self._last = [0.0, 0.0]

    def torque(
        self, error: tuple[float, float], acceleration: tuple[float, float]
    ) -> tuple[float, float]:
        """Return the joint torques [N m] for the sample that starts.

        Args:
            error: Counts, reference minus encoder.
            acceleration: rad/s^2, of the reference.
        """
        servo = self.servo
        torques = []
        for j in (0, 1):
            limit = min(self.limits[j], self.arm.torque_limit)
            lag = error[j] * self.radians
            rate = (lag - self._last[j]) / self.period
            self._last[j] = lag
            torque = (
                servo.stiffness[j] * lag
                + servo.damping[j] * rate
                + servo.feedforward[j] * acceleration[j]
                + self._integral[j]
                + self.offsets[j]
            )
            if abs(torque) < limit:  # no integrator wind-up while the amplifier saturates
                self._integral[j] += servo.stiffness[j] * lag * self.period / servo.integral_time
            torques.append(max(-limit, min(limit, torque)))
        return torques[0], torques[1]


class ServoFinger(SteppedFinger):
    """Two links, their motors under the controller's position loops.

    Link 1 rotates with joint 1 and carries its armature inertia. The armature of joint 2 resists
    the relative rotation of the two links, which no rigid body can represent. Behind backlash a
    motor has an angle of its own.

    Args:
        start: rad, joints when power comes on.
        scene: With its gravity, joints and fingertip.

    Raises:
        SceneError: The motor of joint 2 has a rotor without backlash, or one with it has none.
    """

    def __init__(
        self,
        space: pymunk.Space,
        key: StiffKey,
        rig: Rig,
        start: tuple[float, float],
        servo: Servo,
        scene: Scene,
    ):
        super().__init__(start)
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
        self._rig, arm = rig, rig.arm
        self._space, self._pin = space, key.pin
        self._radians = arm.radians_per_count
        self._period = rig.controller.sample_period
        self._loops = PositionLoops(servo, arm, self._period, scene.gravity)
        self._base = arm.base_x * bodies.MM, arm.base_z * bodies.MM
        self._lengths = arm.upper_length * bodies.MM, arm.lower_length * bodies.MM
        self._height = (rig.key.surface_height + arm.fingertip_radius) * bodies.MM
        self.upper, self.lower = bodies.add_arm(space, arm, start)
        self.upper.moment += (not loose[0]) * first * bodies.INERTIA
        self._motors = [
            Motor(joints, j, rotors[j], start[j]) if loose[j] else None for j in range(2)
        ]
        self._loose = [motor for motor in self._motors if motor is not None]
        motors = bodies.brakes(space, self.upper, self.lower)
        self.dry = [
            (joint, force * bodies.MM)
            for joint, force, motor in zip(motors, joints.dry_friction, self._motors, strict=True)
            if force and motor is None
        ]
        """Dry friction of the joints whose motors turn with the links, with its limits [N mm]."""
        for joint, force in self.dry:
            joint.max_force = force
            space.add(joint)
        self._viscous = [
            0.0 if loose[j] else joints.viscous_friction[j] * bodies.MM**2 for j in range(2)
        ]
        if scene.fingertip is not None:
            self.pad = Pad(scene.fingertip, key, self._height)
        else:
            self._tip = bodies.add_fingertip(space, key.lever, self.lower, rig.key, arm)
        self._brakes = bodies.brakes(space, self.upper, self.lower)
        space.add(*self._brakes)
        self._start = start
        self._powered = False
        self._driven = scene.joints is not None
        self._separated = False
        self._force = self._foreseen = 0.0
        self._rate: float | None = None  # of the key after a trial of a step, in which it may jump
        self._error = (0.0, 0.0)
        self._torque = (0.0, 0.0)
        self._correction = (0.0, 0.0)
        self._targets: list[
            tuple[pymunk.Body, pymunk.Vec2d, tuple[float, float], float, float]
        ] = []
        self._omegas = (0.0, 0.0)
        self._acceleration = (0.0, 0.0)

    def joints(self) -> tuple[float, float]:
        first, second = self._motors
        q1 = self.upper.angle
        q2 = self.lower.angle - q1
        return q1 if first is None else first.angle, q2 if second is None else second.angle

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

    def torques(self) -> tuple[float, float]:
        return self._torque[0] / bodies.MM, self._torque[1] / bodies.MM

    def drive(self, offsets: tuple[float, float], limits: tuple[float, float]) -> None:
        self._loops.offsets, self._loops.limits = offsets, limits

    def block(self, joint: int) -> None:
        self._space.add(bodies.brakes(self._space, self.upper, self.lower)[joint])

    @property
    def settled(self) -> bool:
        """Whether both loops are within `settled_within`, or the motors are off."""
        within = settled_within(self._rig.arm) / self._radians
        return not self._powered or max(map(abs, self._error)) <= within

    def begin_sample(self, reference: Reference, powered: bool, time: float) -> bool:
        """Read the encoders and set the torques for a controller sample; see `SteppedFinger`."""
        jumped = powered != self._powered
        if jumped:
            self._powered = powered
            if powered:
                self._space.remove(*self._brakes)
                for motor in self._loose:
                    motor.hold()
                self._loops.engage(self.joints())
            else:
                self._space.add(*self._brakes)
        before = self._torque
        self._torque = self._set(reference) if powered else (0.0, 0.0)
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
        if self.pad is not None or self.friction is not None:
            back = kick.fraction * kick.step - kick.ahead / 2  # to the middle of the last step
            place, velocity, along = self._tip_after(kick.step, back)
            if self.pad is not None:
                x, z, moment = self.pad.press(place, velocity, angle, omega, kick)
            elif self.friction is not None:
                rate = omega if self._rate is None else self._rate
                part = self.friction.part(self._force, rate, kick.step)  # no blow's force
                x, z, moment = self.friction.rub(self._foreseen * part * kick.fraction, angle)
            bodies.set_force(self.lower, (x, z))
            moment += along[0] / 2 * z - along[1] / 2 * x
        bodies.set_torque(self.lower, second + moment)
        bodies.set_torque(self.upper, first - second)

    def _through_joints(self, torques: tuple[float, float], kick: Kick) -> tuple[float, float]:
        """Return the torques [N mm] on the links, by the motors' ones in a step."""
        w1, w2 = self.upper.angular_velocity, self.lower.angular_velocity
        q1, rates = self.upper.angle + w1 * kick.step, (w1, w2 - w1)
        places = q1, self.lower.angle + w2 * kick.step - q1
        passed = [0.0, 0.0]
        for j, motor in enumerate(self._motors):
            if motor is None:
                passed[j] = torques[j] - self._viscous[j] * rates[j] * kick.fraction
            elif self._powered:
                passed[j] = motor.drive(torques[j], kick, places[j], rates[j])
        return passed[0], passed[1]

    def retries(self, weight: float) -> bool:
        if self.friction is None or self._separated:
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
        first, second = self._omegas
        self._omegas = a, b = self.upper.angular_velocity, self.lower.angular_velocity
        self._acceleration = (a - first) / weight, (b - second) / weight
        if self.pad is not None:
            self.pad.end_step()
            return self.pad.force
        if self._separated:
            return 0.0
        force = self._tip.impulse / weight
        if not force > 0:
            self._separated = True
            self._tip.max = 2 * bodies.FAR
        self._foreseen, self._force = max(0.0, 2 * force - self._force), force
        return force

    def reaches_key(self, angle: float, step: float) -> bool:
        return self.gap(angle, step, step) < 0

    def gap(self, angle: float, time: float, ahead: float) -> float:
        if not (self._separated if self.pad is None else self.pad.separated):
            return math.inf
        (a, b), (acceleration1, acceleration2) = self._omegas, self._acceleration
        forward = (time - ahead) / 2
        a, b = a + acceleration1 * forward, b + acceleration2 * forward
        first, second = self.upper.angle + a * time, self.lower.angle + b * time
        l1, l2 = self._lengths
        x = self._base[0] + l1 * math.cos(first) + l2 * math.cos(second)
        z = self._base[1] + l1 * math.sin(first) + l2 * math.sin(second)
        z -= self._pin.at(time, ahead)
        return z * math.cos(angle) - x * math.sin(angle) - self._height

    def make_contact(self, time: float) -> None:
        if self.pad is not None:
            self.pad.make_contact()
            return
        self._separated = False
        self._tip.max = bodies.FAR - bodies.REACH

    def correct_and_drift(self, back: float, drift: float) -> None:
        (a, b), (acceleration1, acceleration2) = self._omegas, self._acceleration
        self._omegas = a, b = a - acceleration1 * back, b - acceleration2 * back
        first, second = self.upper.angle, self.lower.angle
        if self._powered:
            for motor in self._loose:
                motor.correct_and_drift(back, drift)
        l1, l2 = self._lengths
        x, z = -l1 * math.sin(first) * a, l1 * math.cos(first) * a
        end_x, end_z = -l2 / 2 * math.sin(second) * b, l2 / 2 * math.cos(second) * b
        self._targets = [
            (body, position + drift * pymunk.Vec2d(*speed), speed, angle + omega * drift, omega)
            for body, position, speed, angle, omega in (
                (self.upper, self.upper.position, (x / 2, z / 2), first, a),
                (self.lower, self.lower.position, (x + end_x, z + end_z), second, b),
            )
        ]

    def set_bodies(self, step: float) -> None:
        if self._powered:
            for motor in self._loose:
                motor.set_back(step)
        for body, place, speed, angle, omega in self._targets:
            body.position = place - step * pymunk.Vec2d(*speed)
            body.velocity = speed
            body.angle, body.angular_velocity = angle - omega * step, omega

    def end_sample(self, angle: float) -> tuple[float, float]:
        l1, l2 = self._lengths
        first, second = self.upper.angle, self.lower.angle
        up_x, up_z = l1 / 2 * math.cos(first), l1 / 2 * math.sin(first)
        out_x, out_z = l2 / 2 * math.cos(second), l2 / 2 * math.sin(second)
        (x, z), (lower_x, lower_z) = self.upper.position, self.lower.position
        shoulder = math.hypot(x - up_x - self._base[0], z - up_z - self._base[1])
        hinge = math.hypot(x + up_x - lower_x + out_x, z + up_z - lower_z + out_z)
        tip_x, tip_z = lower_x + out_x, lower_z + out_z - self._pin.value
        if self.pad is not None:
            return angle, max(shoulder, hinge)
        gap = tip_z * math.cos(angle) - tip_x * math.sin(angle) - self._height
        if gap < 0 or (not self._separated and gap < bodies.REACH):
            angle = float(touching_angle(self._rig, np.array([tip_x, tip_z]) / bodies.MM))
        return angle, max(shoulder, hinge, -gap)

    def _tip_after(
        self, step: float, back: float
    ) -> tuple[tuple[float, float], tuple[float, float], tuple[float, float]]:
        """Return place and velocity of the fingertip after a step, and link 2 [mm, mm/ms].

        Args:
            step: ms, of the engine.
            back: ms, before the end of the step, for which the bodies' velocities hold.
        """
        (w1, w2), (accelerated1, accelerated2) = self._omegas, self._acceleration
        first, second = self.upper.angle, self.lower.angle
        first += self.upper.angular_velocity * step
        second += self.lower.angular_velocity * step
        w1, w2 = w1 + accelerated1 * back, w2 + accelerated2 * back
        joints, rates = (first, second - first), (w1, w2 - w1)
        place, velocity = fingertip_state(self._base, self._lengths, joints, rates)
        l2 = self._lengths[1]
        return place, velocity, (l2 * math.cos(second), l2 * math.sin(second))

    def _set(self, reference: Reference) -> tuple[float, float]:
        """Return the motors' torques [N mm] for the sample that starts."""
        counts, speeds = reference(_ENDS)
        (requested, _), (now, then) = counts.tolist(), speeds.tolist()
        joints, radians = self.joints(), self._radians
        start = self._start
        self._error = error = (
            requested[0] - round((joints[0] - start[0]) / radians),
            requested[1] - round((joints[1] - start[1]) / radians),
        )
        per_sample = radians / self._period**2
        acceleration = (then[0] - now[0]) * per_sample, (then[1] - now[1]) * per_sample
        first, second = self._loops.torque(error, acceleration)
        return first * bodies.MM, second * bodies.MM
