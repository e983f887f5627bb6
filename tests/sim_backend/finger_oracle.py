"""The oracle with an ideal or a servo finger: an arm of two rods whose tip presses the key.

It is written from the equations of docs/stand-in.md, in the links' absolute angles t1 = q1 and
t2 = q1 + q2. With the gap g(a, t1, t2) = z cos a - x sin a - hf - r between key and fingertip, a
force F >= 0 has the moment F dg/da on the key, and F dg/dt on the links. With friction, a force T
acts on the key along its surface towards the front edge, T hf about the pin, and -T on the point of
link 2 that touches the key.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from tests.sim_backend.oracle import APART, FINGER, Oracle

GRAZE = 20e-6  # s, of a fingertip through the key that may be overlooked
GRAZED = 1e-12  # m


class Reference:
    """The motion that the controller requests: cubic in time between points at its samples."""

    def __init__(self, rig, samples, joints, speeds):
        """Take the points' samples, their joint angles [rad] and speeds [rad/s], shape (n, 2)."""
        self.period, self.start = rig.controller.sample_period, tuple(joints[0].tolist())
        self.samples, self.count = samples, rig.arm.radians_per_count
        self.joints = CubicHermiteSpline(samples * self.period, joints, speeds)

    def counts(self, times):
        """Return positions [counts] from the start and speeds [counts per sample], shape (n, 2)."""
        speeds = self.joints(times, 1) * self.period / self.count
        return (self.joints(times) - self.start) / self.count, speeds

    def of_sample(self, number):
        """Return what a world asks for in a sample."""
        return lambda fractions: self.counts((number + np.asarray(fractions)) * self.period)


@dataclass
class Reach:
    """The fingertip on the key: the gap [m], its derivatives, and what it does without a force."""

    gap: float
    lever: float  # dg/da
    arm: float  # moment on the key per N, with friction
    links: np.ndarray  # dg/dt
    opening: float  # speed of the gap over a key at rest, m/s
    free: float  # acceleration of the gap over a key that keeps its speed, m/s^2
    rates: np.ndarray  # accelerations of the links, rad/s^2
    yields: np.ndarray  # accelerations of the links per N, with friction

    def grip(self, rate, moment, inertia):
        """Return the force that cancels a rate of the gap on such a key, and its lever."""
        compliance = self.links @ self.yields + self.lever * self.arm / inertia
        if compliance == 0:
            return -np.inf, self.arm  # a finger that leaves a key on its rail
        return -(rate + self.lever * moment / inertia) / compliance, self.arm


class FingerOracle(Oracle):
    """A key at rest on its rail, and above it a finger that follows a `Reference`."""

    def __init__(self, rig, scene, reference):
        super().__init__(rig, scene)
        self.arm, self.reference, self.ideal = rig.arm, reference, scene.finger == "ideal"
        self.limit, self.servo = rig.arm.torque_limit, scene.servo
        self.links = 2 + 2 * len(self.jacks)
        self.lengths = np.array([rig.arm.upper_length, rig.arm.lower_length])
        self.top = rig.key.surface_height + rig.arm.fingertip_radius
        self.motors, self.jerk = np.zeros(2), np.zeros(2)
        self.error, self.integral = np.zeros(2), np.zeros(2)
        self.weight = self.gravity(np.cumsum(reference.start)) @ [[1, 0], [1, 1]]

    # The arm

    def gravity(self, links):
        """Return the moments [N m] of the links' weight, downwards, on their absolute angles."""
        masses = np.array([self.arm.upper_mass / 2 + self.arm.lower_mass, self.arm.lower_mass / 2])
        return self.scene.gravity * masses * self.lengths * np.cos(links)

    def turning(self, links, speeds, gradient):
        """Return the links' accelerations [rad/s^2], and those per N on the fingertip."""
        arm = self.arm
        first = (arm.upper_mass / 3 + arm.lower_mass) * arm.upper_length**2
        first += arm.rotor_inertias[0] * arm.gear_ratios[0] ** 2
        second = arm.lower_mass * arm.lower_length**2 / 3
        both = arm.lower_mass * arm.upper_length * arm.lower_length / 2
        mixed, twist = (both * part(links[1] - links[0]) for part in (np.cos, np.sin))
        rotor = arm.rotor_inertias[1] * arm.gear_ratios[1] ** 2  # turns by the links' difference
        first, second, mixed = first + rotor, second + rotor, mixed - rotor
        inverse = np.array([[second, -mixed], [-mixed, first]]) / (first * second - mixed**2)
        moments = self.motors - self.gravity(links)
        moments += twist * speeds[1] ** 2, -twist * speeds[0] ** 2
        return inverse @ moments, inverse @ gradient

    def gap(self, u):
        """Return the gap [m] in one state, or in several of shape (n, times)."""
        links = u[self.links : self.links + 2]
        x = self.arm.base_x + self.lengths @ np.cos(links)
        z = self.arm.base_z + self.lengths @ np.sin(links)
        return z * np.cos(u[0]) - x * np.sin(u[0]) - self.top

    def reach(self, u, rub=0.0):
        """Return the `Reach` with a fraction of the force that acts towards the front edge."""
        a, w, arm, lengths = u[0], u[1], self.arm, self.lengths
        links, speeds = u[self.links : self.links + 2], u[self.links + 2 : self.links + 4]
        cos, sin, ca, sa = np.cos(links), np.sin(links), np.cos(a), np.sin(a)
        x, z = arm.base_x + lengths @ cos, arm.base_z + lengths @ sin
        vx, vz = -lengths * sin @ speeds, lengths * cos @ speeds
        ax, az = -lengths * cos @ speeds**2, -lengths * sin @ speeds**2
        height, gradient = z * ca - x * sa, lengths * (cos * ca + sin * sa)
        if self.ideal:
            rates, yields = u[self.links + 4 :], np.zeros(2)
        else:
            # The point that touches the key is the fingertip's radius below the centre.
            slip = lengths * (cos * sa - sin * ca) + [0.0, arm.fingertip_radius]
            rates, yields = self.turning(links, speeds, gradient + rub * slip)
        lever = -(x * ca + z * sa)
        free = az * ca - ax * sa - 2 * w * (vx * ca + vz * sa) - w**2 * height
        return Reach(
            height - self.top,
            lever,
            lever + rub * self.key.surface_height,
            gradient,
            vz * ca - vx * sa,
            free + gradient @ rates,
            rates,
            yields,
        )

    # Its place in the oracle

    def finger(self, u, moment, inertia, rub):
        if not self.touch:
            return 0.0, 0.0
        reach = self.reach(u, rub)
        return reach.grip(reach.free, moment, inertia)

    def blow(self, u, momentum, inertia, rub):
        reach = self.reach(u, rub)
        return reach.grip(reach.opening, momentum, inertia)

    def leads(self, u):
        return (self.touch and self.ideal) or super().leads(u)

    def gaps(self, u):
        return super().gaps(u) | {FINGER: self.gap(u)}

    def opening(self, u, speed):
        reach = self.reach(u)
        return reach.opening + reach.lever * speed

    def placed(self, u):
        reach = self.reach(u)
        u[self.links : self.links + 2] -= reach.gap * reach.links / (reach.links @ reach.links)
        return u

    def struck(self, u, impulse, rub):
        u[self.links + 2 : self.links + 4] += self.reach(u, rub).yields * impulse
        return u

    def right(self, t, u):
        alpha, rates, _, force, rub = self.accelerations(u)
        reach = self.reach(u, rub)
        jacks = (x for n, r in enumerate(rates) for x in (u[3 + 2 * n], r))
        turning = reach.rates + reach.yields * force
        speeds = u[self.links + 2 : self.links + 4]
        return [u[1], alpha, *jacks, *speeds, *turning, *(self.jerk if self.ideal else ())]

    def guards(self):
        if self.touch:
            return [*super().guards(), ("leave", FINGER, lambda u: self.accelerations(u)[3])]
        return [*super().guards(), ("land", FINGER, lambda u: self.gap(u) + APART)]

    def overlap(self, piece):
        if self.touch:
            return None
        times = np.arange(piece.t[0] + GRAZE, piece.t[-1] - GRAZE, GRAZE)
        inside = times[self.gap(piece.sol(times)) < -GRAZED] if len(times) else times
        return inside[0] if len(inside) else None

    def holds(self, u, touching, small=1e-12):
        if self.touch and self.stick and self.ideal:
            return False  # two rests: the force between them is not determined
        alpha, _, _, force, _ = self.accelerations(u)
        if self.touch and force < -small:
            return False
        if FINGER in touching and not self.touch:
            reach = self.reach(u)
            if reach.free + reach.lever * alpha < 0:
                return False
        return super().holds(u, touching, small)

    # The controller

    def begin(self):
        return np.zeros(self.links + (6 if self.ideal else 4))

    def ends(self, end):
        period = self.reference.period
        samples = self.reference.samples if self.ideal else np.arange(round(end / period))
        inner = samples * period
        return [*inner[(inner > 0) & (inner < end)].tolist(), end]

    def renew(self, u):
        if self.ideal:
            joints, middle = self.reference.joints, self.time + self.reference.period / 2
            self.jerk = np.cumsum(joints(middle, 3))
            place = [np.cumsum(joints(self.time, n)) for n in range(2)]
            rate = np.cumsum(joints(middle, 2)) - self.jerk * self.reference.period / 2
            u[self.links :] = np.concatenate([*place, rate])
            return u
        period, count = self.reference.period, self.reference.count
        if self.time == 0:
            u[self.links : self.links + 2] = np.cumsum(self.reference.start)
        joints = np.diff(u[self.links : self.links + 2], prepend=0.0) - self.reference.start
        goals, speeds = self.reference.counts(self.time + np.array([0.0, period]))
        error = (goals[0] - np.round(joints / count)) * count
        before, self.error = self.error, error
        servo, acceleration = self.servo, (speeds[1] - speeds[0]) * count / period**2
        torque = np.multiply(servo.stiffness, error + self.integral) + self.weight
        torque += np.multiply(servo.damping, error - before) / period
        torque += np.multiply(servo.feedforward, acceleration)
        limited = np.clip(torque, -self.limit, self.limit)
        self.integral += error * period / servo.integral_time * (torque == limited)
        self.motors = np.array([limited[0] - limited[1], limited[1]])
        return u


def solve(rig, scene, reference, end, times=()):
    """Return the `Solution` of a scene with a finger that follows a reference."""
    return FingerOracle(scene.true_rig(rig), scene, reference).solve(end, times)
