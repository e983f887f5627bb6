"""A motion as a controller takes it: whole counts and whole samples, cubic in between."""

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
    """Counts a second at the end of each segment; shape (n_segments, 2)."""
    samples: Counts
    """Controller samples that each segment lasts; shape (n_segments,)."""

    @cached_property
    def ends(self) -> Counts:
        """Controller samples at which segments begin and end, from 0; shape (n_segments + 1,)."""
        return np.concatenate([[0], np.cumsum(self.samples)])

    def __len__(self) -> int:
        return len(self.samples)

    @property
    def total_samples(self) -> int:
        """Controller samples of the whole motion."""
        return int(self.samples.sum())

    @property
    def end(self) -> Counts:
        """Counts, absolute joint positions after the last segment; shape (2,)."""
        return self.start + self.steps.sum(axis=0)

    def reversed(self) -> "Segments":
        """The same way back, from `end` to `start` and as fast."""
        ends = np.concatenate([[[0, 0]], self.velocities])
        return Segments(self.end, -self.steps[::-1], -ends[-2::-1], self.samples[::-1])


def segments_document(
    segments: Segments, sample_period: float, home: Counts, hover: Counts
) -> dict[str, object]:
    """Return a motion as JSON would hold it, for whoever drives a controller by hand.

    Args:
        segments: What is to be sent.
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
