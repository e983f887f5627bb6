"""The equations of a scene in one mode."""

from dataclasses import dataclass
from typing import NamedTuple

from sautereau.sim_backend.physics.reference.drive_segments import Leg
from sautereau.sim_backend.physics.reference.linkage import Inertia, Touch
from sautereau.sim_backend.physics.reference.mode import Felt, JackMode, Meeting, Mode
from sautereau.sim_backend.physics.reference.system import State, System


class JackInstant(NamedTuple):
    """A jack and the key under it, at an instant."""

    mode: JackMode
    rise: float
    speed: float
    acceleration: float
    foot: float
    """m, rise of the key under it."""
    slope: float
    """m/rad, of that by the angle."""
    bend: float
    """m/s^2, of the foot at a steady speed of the key."""
    burden: float
    """N, downwards, without friction and inertia."""
    load: float
    """N, on the key as it moves; where the key stands, the most that it can be."""
    string: float
    """N, downwards."""


@dataclass(frozen=True)
class Instant:
    """All that follows from a mode and a state."""

    angle: float
    spin: float
    acceleration: float
    jacks: list[JackInstant]
    joints: tuple[float, ...]
    """rad/s^2, of the arm; empty without one."""
    touch: Touch | None
    finger: float
    """N m, of the fingertip on the key; 0 where it does not touch."""
    balance: float
    """N m, of all on the key without dry friction and rail."""
    dry: float
    """N m, with which friction holds against a rise."""
    dry_down: float
    """N m, with which friction holds against a fall."""

    def complete(self, x: State) -> State:
        """Return the state with what follows from the rest of it."""
        full = [self.angle, self.spin]
        for jack in self.jacks:
            full += [jack.rise, jack.speed]
        return full + x[len(full) :]


class Stretch:
    """The bench in one mode, over one leg."""

    def __init__(self, system: System, leg: Leg, mode: Mode, meeting: Meeting):
        self.system, self.leg, self.mode, self.meeting = system, leg, mode, meeting
        self.led = mode.touch and leg.path is not None
        self.moving = bool(
            system.arm
            or (mode.slip and not self.led)
            or any(j in (JackMode.RISES, JackMode.FALLS) for j in mode.jacks)
        )
        """Whether there is anything to integrate."""

    def at(self, time: float, x: State) -> Instant:
        """Return the motion and the forces at a time [s] in a state."""
        system, mode, leg, meeting = self.system, self.mode, self.leg, self.meeting
        angle, spin, lead = x[0], x[1], 0.0
        touch = None
        if leg.path:
            led = leg.path.lead(time)
            touch, lead = led.touch, led.acceleration
        elif system.arm:
            touch = system.arm.touch(*x[-4:])
        if touch and mode.touch and (mode.slip or self.led):
            angle, spin = touch.angle, touch.spin
        if not mode.slip:
            spin = 0.0
        inertia = system.inertia
        balance = leg.moment + system.heaviness - system.viscous * spin
        if meeting.felt is Felt.PRESSED:
            balance -= system.felt(angle, spin)
        dry = dry_down = system.dry
        jacks = []
        for k, jack in enumerate(system.jacks):
            kind, rise, speed = mode.jacks[k], x[2 + 2 * k], x[3 + 2 * k]
            foot, slope, curve = jack.foot(angle)
            bend = curve * spin * spin
            if kind is JackMode.STANDS:
                rise, speed = foot, slope * spin
            string = jack.string_force(meeting.strings[k], rise)
            burden = jack.burden(string, meeting.damped[k], rise)
            acceleration = 0.0
            if kind is JackMode.STANDS:
                inertia += jack.mass * slope * slope
                balance -= slope * (jack.mass * bend + burden)
                dry += slope * jack.friction
                dry_down += slope * min(jack.friction, burden)
            elif kind is JackMode.HANGS:
                speed = 0.0
            else:
                acceleration = -(burden + kind * jack.friction) / jack.mass
            jacks.append((kind, rise, speed, acceleration, foot, slope, bend, burden, string, jack))
        acceleration, joints, finger = self._accelerations(x, touch, lead, inertia, balance, dry)
        if not mode.touch:
            finger = 0.0
        elif self.led:
            finger = inertia * acceleration - balance + mode.slip * dry
            if not mode.slip:  # friction holds the key as long as it can, the finger the rest
                finger = -balance - min(max(-balance, -dry), dry_down)
        done = []
        for kind, rise, speed, own, foot, slope, bend, burden, string, jack in jacks:
            load = 0.0
            if kind is JackMode.STANDS:
                own = slope * acceleration + bend
                load = jack.mass * own + burden + (mode.slip or 1) * jack.friction
            done.append(
                JackInstant(kind, rise, speed, own, foot, slope, bend, burden, load, string)
            )
        return Instant(
            angle, spin, acceleration, done, joints, touch, finger, balance + finger, dry, dry_down
        )

    def rates(self, time: float, x: State) -> State:
        """Return the derivative of the state; that of what follows from the rest is zero."""
        now, mode = self.at(time, x), self.mode
        free = mode.slip and not mode.touch
        rates = [now.spin, now.acceleration] if free else [0.0, 0.0]
        for jack in now.jacks:
            flies = jack.mode in (JackMode.RISES, JackMode.FALLS)
            rates += [jack.speed, jack.acceleration] if flies else [0.0, 0.0]
        if now.joints:
            rates += [x[-2], x[-1], *now.joints]
        return rates

    def complete(self, time: float, x: State) -> State:
        """Return the state with what follows from the rest of it."""
        return self.at(time, x).complete(x)

    def _accelerations(
        self,
        x: State,
        touch: Touch | None,
        lead: float,
        inertia: float,
        balance: float,
        dry: float,
    ) -> tuple[float, tuple[float, ...], float]:
        """Return the accelerations of key and joints, and the finger's moment of a servo."""
        mode, arm = self.mode, self.system.arm
        pushed = balance - mode.slip * dry
        alone = lead if self.led else pushed / inertia if mode.slip else 0.0
        if arm is None or touch is None:
            return alone, (), 0.0
        own = arm.inertia(*x[-4:])
        torque1, torque2 = self.leg.torques
        right1, right2 = torque1 - own.load1, torque2 - own.load2
        a1, a2, bend = touch.slope1, touch.slope2, touch.bend
        if not mode.touch:
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
            rest = pushed - inertia * bend
            s1, s2 = both.solve(right1 + a1 * rest, right2 + a2 * rest)
            acceleration = a1 * s1 + a2 * s2 + bend
            return acceleration, (s1, s2), inertia * acceleration - pushed
        free1, free2 = own.solve(right1, right2)
        by1, by2 = own.solve(a1, a2)
        finger = (a1 * free1 + a2 * free2 + bend) / (a1 * by1 + a2 * by2)
        return 0.0, (free1 - finger * by1, free2 - finger * by2), finger
