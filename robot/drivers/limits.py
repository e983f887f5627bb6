"""What the arm may be asked for, in encoder counts; refused before anything is sent."""

import math

import numpy as np

from sautereau.rig.schema import Arm
from sautereau.robot.errors import NotReady, UnsafeRequest
from sautereau.trajectory.counts import to_angles, to_counts
from sautereau.trajectory.segments import Counts, Segments

_TOLERANCE = 25e-6
_ROUNDING = 1.01
"""Share of the speed limit that rounding to counts and samples may reach."""
_RUN_UP = 0.1  # s, from rest to the speed of a move
_STEP_OF_ACCELERATION = 1024  # counts/s^2, resolution of AC and DC
_LARGEST_ACCELERATION = 1_073_740_800  # counts/s^2


class Limits:
    """The arm's limits: counts and counts a second."""

    def __init__(self, arm: Arm):
        self._turn = arm.counts_per_revolution
        self.lower = to_counts(arm.lower_limits, self._turn)
        """Counts, of the two joints."""
        self.upper = to_counts(arm.upper_limits, self._turn)
        """Counts, of the two joints."""
        self.speed = self.in_counts(arm.speed_limit)
        """Counts a second, of either joint."""
        self.acceleration = self.in_counts(arm.acceleration_limit)
        """Counts a second squared, of either joint."""
        self.tolerance = max(2, round(_TOLERANCE * self._turn))
        """Counts between where a joint should stand and where it may."""

    def in_counts(self, angle: float) -> float:
        """Return counts (a second) of an angle (a second) in rad."""
        return angle * self._turn / (2 * math.pi)

    def profile(self, speed: float) -> tuple[str, str, str]:
        """Return SP, AC and DC for a move at ``speed`` counts a second.

        The controller takes even speeds and multiples of 1024 counts/s^2: both are
        rounded down, and are no less than the least of them.
        """
        even = max(2, int(speed) // 2 * 2)
        rate = self._rate(min(speed / _RUN_UP, self.acceleration))
        return f"SP {even},{even}", f"AC {rate},{rate}", f"DC {rate},{rate}"

    @property
    def halting(self) -> str:
        """DC for a decelerated stop, as hard as the arm may take it."""
        rate = self._rate(self.acceleration)
        return f"DC {rate},{rate}"

    def _rate(self, wanted: float) -> int:
        steps = int(min(wanted, _LARGEST_ACCELERATION)) // _STEP_OF_ACCELERATION
        return max(1, steps) * _STEP_OF_ACCELERATION

    def software(self) -> tuple[str, str]:
        """Return FL and BL, beyond which the controller stops by itself."""
        (low_a, low_b), (high_a, high_b) = self.lower, self.upper
        return f"FL {high_a},{high_b}", f"BL {low_a},{low_b}"

    def software_settings(self) -> dict[str, float]:
        """Return what the controller should read back of `software`."""
        (low_a, low_b), (high_a, high_b) = self.lower.tolist(), self.upper.tolist()
        return {"_FLA": high_a, "_FLB": high_b, "_BLA": low_a, "_BLB": low_b}

    def check_move(self, target: Counts, speed: float) -> None:
        """Refuse a move (counts, counts a second) that leaves the limits, with every fault."""
        faults = self._outside("target", target[None])
        if not 0 < speed <= self.speed * (1 + 1e-9):
            faults.append(
                f"speed {speed:.6g} counts/s is not between 0 and arm.speed_limit,"
                f" {self.speed:.6g} counts/s"
            )
        _refuse("move_to", faults, "choose a target and a speed inside them")

    def check_motion(self, segments: Segments, segment_limit: int, sample_period: float) -> None:
        """Refuse segments that the controller cannot or must not play, with every fault."""
        faults = []
        if not 0 < len(segments) <= segment_limit:
            faults.append(
                f"{len(segments)} segments, and the controller takes 1 to {segment_limit}"
                " (controller.segment_limit)"
            )
        if len(segments):
            if (least := segments.samples.min()) < 1:
                faults.append(f"a segment of {least} samples, and one sample is the shortest")
            if segments.velocities[-1].any():
                last = ", ".join(map(str, segments.velocities[-1]))
                faults.append(f"ends at {last} counts/s, and must end at a stand")
            means = segments.steps / (np.maximum(segments.samples, 1) * sample_period)[:, None]
            peak = max(np.abs(means).max(), np.abs(segments.velocities).max())
            if peak > self.speed * _ROUNDING:
                faults.append(
                    f"goes at {peak:.6g} counts/s, and arm.speed_limit is {self.speed:.6g} counts/s"
                )
            knots = np.vstack([segments.start, segments.start + segments.steps.cumsum(axis=0)])
            faults += self._outside("motion", knots)
        _refuse("load", faults, "plan the motion anew")

    def check_at(self, actual: Counts, wanted: Counts, who: str) -> None:
        """Refuse joints that do not stand where they should (counts, shape (2,))."""
        away = np.abs(actual - wanted)
        if (away > self.tolerance).any():
            raise NotReady(
                f"{who} stands at {actual[0]}, {actual[1]} counts and not at {wanted[0]},"
                f" {wanted[1]}, within {self.tolerance} counts; move_to() there first"
            )

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


def _refuse(who: str, faults: list[str], remedy: str) -> None:
    if faults:
        raise UnsafeRequest(f"{who}: {'; '.join(faults)}; {remedy}")
