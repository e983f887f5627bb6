"""The drive of a scene: a planned press, or a push without an arm."""

import math

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.parts import Push
from sautereau.sim_backend.physics.finger import Reference
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.motion import Floats, Motion
from sautereau.trajectory.press import plan_press
from sautereau.trajectory.segments import Segments, motion_at, segment_cubics

LEAD = 20  # Controller samples of rest before a press
TAIL = 20  # Controller samples of rest after a press


class PushDrive:
    """A push of the scene's duration; the arm stays still."""

    def __init__(self, rig: Rig, push: Push):
        self.start = rig.arm.home_angles
        """rad, joints when power comes on."""
        seconds = push.duration + push.rest
        self.samples = math.ceil(seconds / rig.controller.sample_period - 1e-9)
        """Duration in controller samples."""

    def reference(self, sample: int) -> Reference:
        """Return the reference over a controller sample: at rest."""
        return _at_rest

    def ends(self) -> tuple[Floats, Floats]:
        """Return the reference at the ends of all samples; see `PressDrive.ends`."""
        return _at_rest(np.empty(self.samples + 1))


class PressDrive:
    """One press as the controller plays its segments, with a rest before and after.

    Args:
        rig: The bench for which it was planned.
        segments: The press, which starts and ends on the key.
    """

    def __init__(self, rig: Rig, segments: Segments):
        self.period = rig.controller.sample_period
        self.radians = rig.arm.radians_per_count
        self.segments = segments
        first, second = (segments.start * self.radians).tolist()
        self.start = (first, second)
        self._last = segments.total_samples
        self.samples = LEAD + self._last + TAIL
        self._cubics = segment_cubics(segments, 1 / self.radians, self.period)

    def reference(self, sample: int) -> Reference:
        """Return the reference over a sample: counts from the start, and counts per sample."""

        return lambda fractions: self._counts(sample + fractions)

    def ends(self) -> tuple[Floats, Floats]:
        """Return the reference at the ends of all samples at once.

        Returns:
            Counts from the start, and counts per sample, each of shape (samples + 1, 2).
        """
        return self._counts(np.arange(self.samples + 1.0))

    def _counts(self, samples: Floats) -> tuple[Floats, Floats]:
        motion = self.joints(samples * self.period)
        counts = (motion.position - self.start) / self.radians
        return counts, motion.velocity * (self.period / self.radians)

    def joints(self, time: Floats) -> Motion:
        """Return the reference of the joints [rad] at times [s], arrays (n, 2)."""
        sample = np.asarray(time, float) / self.period - LEAD
        inside = np.clip(sample, 0, self._last)
        motion = motion_at(self.segments, self._cubics, inside)
        moving = ((sample >= 0) & (sample < self._last))[:, None]
        return Motion(motion.position, motion.velocity * moving, motion.acceleration * moving)


Drive = PushDrive | PressDrive
"""The reference of a simulation, one controller sample after the other."""


def drive_of(rig: Rig, scene: Scene) -> Drive:
    """Return the drive of a scene: its push, or the rig's planned press.

    Raises:
        SceneError: The rig's press cannot be planned.
    """
    if scene.push is not None:
        return PushDrive(rig, scene.push)
    try:
        return PressDrive(rig, plan_press(rig).segments)
    except TrajectoryError as error:
        raise SceneError(f"rig {rig.name}: {error}") from error


def _at_rest(fractions: Floats) -> tuple[Floats, Floats]:
    return np.zeros((len(fractions), 2)), np.zeros((len(fractions), 2))
