"""A motion in the controller's format: integer counts and samples, interpolated by cubics."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Counts = NDArray[np.int64]


@dataclass(frozen=True)
class Segments:
    """PVT segments of both joints.

    Between two points a controller interpolates with the cubic that has the given
    positions and velocities at its ends.
    """

    start: Counts
    """Counts, absolute joint positions before the first segment; shape (2,)."""
    steps: Counts
    """Counts, relative move of each segment; shape (n_segments, 2)."""
    velocities: Counts
    """Counts per second at the end of each segment; shape (n_segments, 2)."""
    samples: Counts
    """Controller samples of each segment; shape (n_segments,)."""

    @cached_property
    def ends(self) -> Counts:
        """Controller samples at the ends of the segments, from 0; shape (n_segments + 1,)."""
        return np.concatenate([[0], np.cumsum(self.samples)])

    def __len__(self) -> int:
        return len(self.samples)

    @property
    def total_samples(self) -> int:
        """Controller samples of the complete motion."""
        return int(self.samples.sum())

    @property
    def end(self) -> Counts:
        """Counts, absolute joint positions after the last segment; shape (2,)."""
        return self.start + self.steps.sum(axis=0)

    def reversed(self) -> "Segments":
        """The same path backwards, from `end` to `start`, at the same speed."""
        ends = np.concatenate([[[0, 0]], self.velocities])
        return Segments(self.end, -self.steps[::-1], -ends[-2::-1], self.samples[::-1])


def segments_document(
    segments: Segments, sample_period: float, home: Counts, hover: Counts
) -> dict[str, object]:
    """Return a motion as a JSON object, for use with other controllers.

    Args:
        segments: The motion.
        sample_period: s, of one controller sample.
        home: Counts, joint positions at the home switches; shape (2,).
        hover: Counts, joint positions above the key; shape (2,).
    """
    return {
        "sample_period": sample_period,
        "home": home.tolist(),
        "hover": hover.tolist(),
        "start": segments.start.tolist(),
        "steps": segments.steps.tolist(),
        "velocities": segments.velocities.tolist(),
        "samples": segments.samples.tolist(),
    }
