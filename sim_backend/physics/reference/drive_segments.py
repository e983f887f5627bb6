"""Drive segments: the finger's action between two discontinuities of its drive."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.sim_backend.parts import Push, Servo
from sautereau.sim_backend.physics.drive import Drive
from sautereau.sim_backend.physics.reference.linkage import KeyUnderFingertip, Linkage

Pair = tuple[float, float]


@dataclass(frozen=True)
class PrescribedMotion:
    """The key's motion in contact with an ideal fingertip."""

    contact: KeyUnderFingertip
    acceleration: float
    """rad/s^2, of the key."""


@dataclass(frozen=True)
class DriveSegment:
    """An interval over which the finger acts smoothly."""

    start: float
    end: float
    """s."""
    moment: float = 0.0
    """N m, of a push on the key."""
    torques: Pair = (0.0, 0.0)
    """N m, of the servo's motors."""
    path: "FingerPath | None" = None
    """Of an ideal finger; None for any other."""


@dataclass(frozen=True)
class FingerPath:
    """The cubics of both joints over one controller sample."""

    linkage: Linkage
    start: float
    """s."""
    period: float
    """s."""
    cubics: tuple[tuple[float, float, float, float], tuple[float, float, float, float]]
    """rad, p0 + p1 u + p2 u^2 + p3 u^3 of each joint, u from 0 to 1."""

    @property
    def still(self) -> bool:
        """Whether the finger is at rest."""
        return not any(any(cubic[1:]) for cubic in self.cubics)

    def key_motion(self, time: float) -> PrescribedMotion:
        """Return the motion of a key in contact with the fingertip at a time [s]."""
        u = (time - self.start) / self.period
        (q1, d1, s1), (q2, d2, s2) = (self._joint(cubic, u) for cubic in self.cubics)
        contact = self.linkage.key_under_fingertip(q1, q2, d1, d2)
        return PrescribedMotion(contact, contact.slope1 * s1 + contact.slope2 * s2 + contact.bias)

    def _joint(self, cubic: tuple[float, float, float, float], u: float):
        p0, p1, p2, p3 = cubic
        return (
            p0 + ((p3 * u + p2) * u + p1) * u,
            ((3 * p3 * u + 2 * p2) * u + p1) / self.period,
            (6 * p3 * u + 2 * p2) / self.period**2,
        )


class SegmentSource(Protocol):
    """Provides the segments of a drive, one after the other."""

    @property
    def linkage(self) -> Linkage | None:
        """The arm, if it is simulated."""
        ...

    def next_segment(self, time: float, joints: Pair) -> DriveSegment | None:
        """Return the segment that starts at a time [s], or None after the last one.

        Args:
            time: s.
            joints: rad, of the arm, if it is simulated.
        """
        ...


class PushSegments:
    """A push, then no force."""

    linkage = None

    def __init__(self, rig: Rig, push: Push, end: float):
        self.moment, self.duration, self.end = rig.key.press_arm * push.force, push.duration, end

    def next_segment(self, time: float, joints: Pair) -> DriveSegment | None:
        """Return the segment that starts at a time [s], or None after the last one."""
        if time >= self.end:
            return None
        if time < self.duration:
            return DriveSegment(time, min(self.duration, self.end), self.moment)
        return DriveSegment(time, self.end)


class _SampledSegments:
    """One segment per controller sample, from the drive's reference."""

    def __init__(self, rig: Rig, drive: Drive):
        self.drive = drive
        self.period = rig.controller.sample_period
        self.radians = rig.arm.radians_per_count
        self.samples = 0

    def ends(self) -> tuple[Pair, tuple[list[float], list[float]], tuple[list[float], list[float]]]:
        """Return start and end [s] of the next sample, with counts and counts per sample."""
        sample = self.samples
        self.samples += 1
        counts, speeds = self.drive.reference(sample)(np.array([0.0, 1.0]))
        first, last = counts.tolist()
        slow, fast = speeds.tolist()
        return (sample * self.period, self.samples * self.period), (first, last), (slow, fast)


class IdealFingerSegments(_SampledSegments):
    """A fingertip exactly at the reference: a cubic in each controller sample."""

    linkage = None

    def __init__(self, rig: Rig, drive: Drive):
        super().__init__(rig, drive)
        self._kinematics = Linkage(rig)

    def next_segment(self, time: float, joints: Pair) -> DriveSegment | None:
        """Return the segment that starts at a time [s], or None after the last one."""
        if self.samples == self.drive.samples:
            return None
        (start, end), (first, last), (slow, fast) = self.ends()
        cubics = []
        for j in (0, 1):
            step, v0, v1 = last[j] - first[j], slow[j], fast[j]
            p2, p3 = 3 * step - 2 * v0 - v1, v0 + v1 - 2 * step
            place = self.drive.start[j] + first[j] * self.radians
            cubics.append((place, v0 * self.radians, p2 * self.radians, p3 * self.radians))
        path = FingerPath(self._kinematics, start, self.period, (cubics[0], cubics[1]))
        return DriveSegment(start, end, path=path)


class ServoSegments(_SampledSegments):
    """The two position loops: PID on integer counts, with constant torque over each sample.

    For joint j, with the following error e = reference - encoder and its change over a sample:
    k e + c de/dt + J acceleration + integral, limited; the integral k e dt / T grows only while
    the limit is not reached, and starts at the torque of the arm's weight.
    """

    linkage: Linkage

    def __init__(self, rig: Rig, servo: Servo, drive: Drive):
        super().__init__(rig, drive)
        self.linkage = Linkage(rig)
        self.servo = servo
        self.limit = rig.arm.torque_limit
        self.lags = [0.0, 0.0]
        self.integrals = list(self.linkage.weight(*drive.start))

    def next_segment(self, time: float, joints: Pair) -> DriveSegment | None:
        """Return the segment that starts at a time [s], or None after the last one."""
        if self.samples == self.drive.samples:
            return None
        (start, end), (first, _), (slow, fast) = self.ends()
        torques = [0.0, 0.0]
        for j in (0, 1):
            encoder = round((joints[j] - self.drive.start[j]) / self.radians)
            acceleration = (fast[j] - slow[j]) * self.radians / self.period**2
            torques[j] = self._torque(j, (first[j] - encoder) * self.radians, acceleration)
        return DriveSegment(start, end, torques=(torques[0], torques[1]))

    def _torque(self, j: int, lag: float, acceleration: float) -> float:
        servo = self.servo
        change, self.lags[j] = lag - self.lags[j], lag
        torque = self.integrals[j] + servo.stiffness[j] * lag
        torque += servo.damping[j] * change / self.period + servo.feedforward[j] * acceleration
        if abs(torque) < self.limit:
            self.integrals[j] += servo.stiffness[j] * lag * self.period / servo.integral_time
        return math.copysign(min(abs(torque), self.limit), torque)
