"""The arm's limits in encoder counts, checked before anything is sent to a controller."""

import math

import numpy as np

from sautereau.rig.schema import Arm
from sautereau.robot.errors import NotReady, UnsafeRequest
from sautereau.trajectory.segments import Counts, Segments, to_angles, to_counts


class Limits:
    """The arm's limits in counts and counts per second."""

    def __init__(self, arm: Arm):
        self._turn = arm.counts_per_revolution
        self.lower = to_counts(arm.lower_limits, self._turn)
        """Counts, of the two joints."""
        self.upper = to_counts(arm.upper_limits, self._turn)
        """Counts, of the two joints."""
        self.speed = self.in_counts(arm.speed_limit)
        """Counts per second, of either joint."""
        self.acceleration = self.in_counts(arm.acceleration_limit)
        """Counts per second squared, of either joint."""
        self.tolerance = max(2, round(self.in_counts(arm.position_tolerance)))
        """Counts by which a joint may be off its target."""

    def in_counts(self, angle: float) -> float:
        """Return the counts of an angle in rad, or the counts per second of a speed in rad/s."""
        return angle * self._turn / (2 * math.pi)

    def move_acceleration(self, speed: float) -> float:
        """Return the acceleration [counts/s^2] of a move at ``speed`` counts per second."""
        return min(speed / 0.1, self.acceleration)  # 0.1 s from rest to the speed

    def check_move(self, target: Counts, speed: float) -> None:
        """Refuse a move that leaves the limits, and list every fault.

        Args:
            target: Counts, shape (2,).
            speed: Counts per second.
        """
        faults = self._outside("target", target[None])
        if not 0 < speed <= self.speed * (1 + 1e-9):
            faults.append(
                f"speed {speed:.6g} counts/s is not between 0 and arm.speed_limit,"
                f" {self.speed:.6g} counts/s"
            )
        _refuse("move_to", faults, "choose a target and a speed inside them")

    def check_motion(
        self, segments: Segments, segment_limit: int | None, sample_period: float
    ) -> None:
        """Refuse segments that the controller cannot or must not play, and list every fault.

        Args:
            segment_limit: Most segments that the controller holds; None without such a limit.
            sample_period: s, of one controller sample.
        """
        faults = []
        if not len(segments):
            faults.append("it has no segment")
        if segment_limit is not None and len(segments) > segment_limit:
            faults.append(
                f"{len(segments)} segments, and the controller takes {segment_limit} at most"
                " (controller.segment_limit)"
            )
        if len(segments):
            if (least := segments.samples.min()) < 1:
                faults.append(f"a segment has {least} samples, and one sample is the least")
            if segments.velocities[-1].any():
                last = ", ".join(map(str, segments.velocities[-1]))
                faults.append(f"it ends at {last} counts/s, and must end at 0")
            means = segments.steps / (np.maximum(segments.samples, 1) * sample_period)[:, None]
            peak = max(np.abs(means).max(), np.abs(segments.velocities).max())
            if peak > self.speed * 1.01:  # Rounded to counts and samples
                faults.append(
                    f"its speed reaches {peak:.6g} counts/s, and arm.speed_limit is"
                    f" {self.speed:.6g} counts/s"
                )
            knots = np.vstack([segments.start, segments.start + segments.steps.cumsum(axis=0)])
            faults += self._outside("motion", knots)
        _refuse("load", faults, "plan the motion again")

    def off_target(self, actual: Counts, target: Counts) -> str:
        """Return which joints are not at a target, and what to do; empty if both are.

        Args:
            actual: Counts, shape (2,).
            target: Counts, shape (2,).
        """
        away = [int(counts) for counts in np.abs(actual - target)]
        off = [
            f"joint {joint} is {self._angle(counts)} off"
            for joint, counts in enumerate(away, 1)
            if counts > self.tolerance
        ]
        if not off:
            return ""
        return (
            f"{' and '.join(off)} its target, more than arm.position_tolerance,"
            f" {self._angle(self.tolerance)}; check that nothing holds or pushes the arm, such as a"
            " key that is higher than in the rig (`sautereau setup contact`), raise the gains of"
            " its position loops, or raise arm.position_tolerance"
        )

    def check_at(self, actual: Counts, target: Counts) -> None:
        """Refuse joints that are not where a motion starts; counts, shape (2,)."""
        if off := self.off_target(actual, target):
            raise NotReady(f"the arm is not where the motion starts: {off}")

    def _outside(self, what: str, points: Counts) -> list[str]:
        faults = []
        for joint in range(2):
            low, high = int(points[:, joint].min()), int(points[:, joint].max())
            for value, beyond in ((low, low < self.lower[joint]), (high, high > self.upper[joint])):
                if beyond:
                    faults.append(
                        f"{what} of joint {joint + 1} reaches {self._angle(value)}, outside"
                        f" arm limits {self._angle(self.lower[joint])} to"
                        f" {self._angle(self.upper[joint])}"
                    )
        return faults

    def _angle(self, counts: int) -> str:
        return f"{counts} counts ({math.degrees(to_angles(counts, self._turn)):.4g} deg)"


def _refuse(who: str, faults: list[str], fix: str) -> None:
    if faults:
        raise UnsafeRequest(f"{who}: {'; '.join(faults)}; {fix}")
