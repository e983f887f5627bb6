"""Equations of motion of a scene in one mode."""

from dataclasses import dataclass
from typing import NamedTuple

from sautereau.sim_backend.physics.reference.drive_segments import DriveSegment
from sautereau.sim_backend.physics.reference.linkage import Inertia, KeyUnderFingertip
from sautereau.sim_backend.physics.reference.mode import Felt, ForceModes, JackMode, Mode
from sautereau.sim_backend.physics.reference.system import State, System


class JackInstant(NamedTuple):
    """A jack and the key under it, at an instant."""

    mode: JackMode
    rise: float
    speed: float
    acceleration: float
    key_rise: float
    """m, of the key's surface under the jack."""
    slope: float
    """m/rad, derivative of `key_rise` by the angle."""
    bias: float
    """m/s^2, bias acceleration: of the key under the jack at constant angular velocity."""
    static_load: float
    """N, downwards: weight, string and damper."""
    load: float
    """N, on the key as it moves; on a key at rest, the largest possible value."""
    string: float
    """N, downwards."""


@dataclass(frozen=True)
class Instant:
    """Motion and forces that follow from a mode and a state."""

    angle: float
    angular_velocity: float
    acceleration: float
    jacks: list[JackInstant]
    joints: tuple[float, ...]
    """rad/s^2, of the arm; empty without one."""
    contact: KeyUnderFingertip | None
    finger: float
    """N m, of the fingertip on the key; 0 where it does not touch."""
    balance: float
    """N m, sum of the moments on the key without dry friction and rail."""
    dry: float
    """N m, largest friction against an upward motion of the jacks."""
    dry_down: float
    """N m, largest friction against a downward motion of the jacks."""

    def complete(self, x: State) -> State:
        """Return the state with its dependent coordinates computed."""
        full = [self.angle, self.angular_velocity]
        for jack in self.jacks:
            full += [jack.rise, jack.speed]
        return full + x[len(full) :]


class ModeEquations:
    """The equations of motion in one mode, over one drive segment."""

    def __init__(self, system: System, segment: DriveSegment, mode: Mode, force_modes: ForceModes):
        self.system, self.segment, self.mode, self.force_modes = system, segment, mode, force_modes
        self.prescribed = mode.touching and segment.path is not None
        self.moving = bool(
            system.arm
            or (mode.slip and not self.prescribed)
            or any(j in (JackMode.RISES, JackMode.FALLS) for j in mode.jacks)
        )
        """Whether any coordinate must be integrated."""

    def at(self, time: float, x: State) -> Instant:
        """Return the motion and the forces at a time [s] in a state."""
        system, mode, segment, force_modes = self.system, self.mode, self.segment, self.force_modes
        angle, omega, lead_acceleration = x[0], x[1], 0.0
        contact = None
        if segment.path:
            prescribed = segment.path.key_motion(time)
            contact, lead_acceleration = prescribed.contact, prescribed.acceleration
        elif system.arm:
            contact = system.arm.key_under_fingertip(*x[-4:])
        if contact and mode.touching and (mode.slip or self.prescribed):
            angle, omega = contact.angle, contact.angular_velocity
        if not mode.slip:
            omega = 0.0
        inertia = system.inertia
        balance = segment.moment + system.gravity_moment - system.viscous * omega
        if force_modes.felt is Felt.PRESSED:
            balance -= system.felt(angle, omega)
        dry = dry_down = system.dry
        jacks = []
        for k, jack in enumerate(system.jacks):
            jack_mode, rise, speed = mode.jacks[k], x[2 + 2 * k], x[3 + 2 * k]
            key_rise, slope, curve = jack.kinematics(angle)
            bias = curve * omega * omega
            if jack_mode is JackMode.STANDS:
                rise, speed = key_rise, slope * omega
            string = jack.string_force(force_modes.strings[k], rise)
            static_load = jack.static_load(string, force_modes.damped[k], rise)
            acceleration = 0.0
            if jack_mode is JackMode.STANDS:
                inertia += jack.mass * slope * slope
                balance -= slope * (jack.mass * bias + static_load)
                dry += slope * jack.friction
                dry_down += slope * min(jack.friction, static_load)
            elif jack_mode is JackMode.HANGS:
                speed = 0.0
            else:
                acceleration = -(static_load + jack_mode * jack.friction) / jack.mass
            jacks.append(
                (jack_mode, rise, speed, acceleration, key_rise, slope, bias, static_load, string)
            )
        acceleration, joints, finger = self._accelerations(
            x, contact, lead_acceleration, inertia, balance, dry
        )
        if not mode.touching:
            finger = 0.0
        elif self.prescribed:
            finger = inertia * acceleration - balance + mode.slip * dry
            if not mode.slip:  # friction carries as much as it can, the finger the remainder
                finger = -balance - min(max(-balance, -dry), dry_down)
        done = []
        for jack, moving in zip(system.jacks, jacks, strict=True):
            jack_mode, rise, speed, own, key_rise, slope, bias, static_load, string = moving
            load = 0.0
            if jack_mode is JackMode.STANDS:
                own = slope * acceleration + bias
                load = jack.mass * own + static_load + (mode.slip or 1) * jack.friction
            done.append(
                JackInstant(
                    jack_mode, rise, speed, own, key_rise, slope, bias, static_load, load, string
                )
            )
        total = balance + finger
        return Instant(
            angle, omega, acceleration, done, joints, contact, finger, total, dry, dry_down
        )

    def rates(self, time: float, x: State) -> State:
        """Return the derivative of the state; that of a dependent coordinate is zero."""
        now, mode = self.at(time, x), self.mode
        free = mode.slip and not mode.touching
        rates = [now.angular_velocity, now.acceleration] if free else [0.0, 0.0]
        for jack in now.jacks:
            flies = jack.mode in (JackMode.RISES, JackMode.FALLS)
            rates += [jack.speed, jack.acceleration] if flies else [0.0, 0.0]
        if now.joints:
            rates += [x[-2], x[-1], *now.joints]
        return rates

    def complete(self, time: float, x: State) -> State:
        """Return the state with its dependent coordinates computed."""
        return self.at(time, x).complete(x)

    def _accelerations(
        self,
        x: State,
        contact: KeyUnderFingertip | None,
        lead_acceleration: float,
        inertia: float,
        balance: float,
        dry: float,
    ) -> tuple[float, tuple[float, ...], float]:
        """Return the accelerations of key and joints, and the moment of a servo's fingertip."""
        mode, arm = self.mode, self.system.arm
        pushed = balance - mode.slip * dry
        alone = lead_acceleration if self.prescribed else pushed / inertia if mode.slip else 0.0
        if arm is None or contact is None:
            return alone, (), 0.0
        own = arm.inertia(*x[-4:])
        torque1, torque2 = self.segment.torques
        right1, right2 = torque1 - own.load1, torque2 - own.load2
        a1, a2, bias = contact.slope1, contact.slope2, contact.bias
        if not mode.touching:
            return alone, own.solve(right1, right2), 0.0
        if mode.slip:
            # M q'' = torques - A' finger and inertia (A q'' + bend) = pushed + finger.
            both = Inertia(
                own.m11 + inertia * a1 * a1,
                own.m12 + inertia * a1 * a2,
                own.m22 + inertia * a2 * a2,
                0.0,
                0.0,
            )
            rest = pushed - inertia * bias
            s1, s2 = both.solve(right1 + a1 * rest, right2 + a2 * rest)
            acceleration = a1 * s1 + a2 * s2 + bias
            return acceleration, (s1, s2), inertia * acceleration - pushed
        free1, free2 = own.solve(right1, right2)
        by1, by2 = own.solve(a1, a2)
        finger = (a1 * free1 + a2 * free2 + bias) / (a1 * by1 + a2 * by2)
        return 0.0, (free1 - finger * by1, free2 - finger * by2), finger
