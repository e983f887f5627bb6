"""A motion in the controller's format: integer counts and samples, interpolated by cubics."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sautereau.trajectory.motion import Floats, Motion

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


def to_counts(angles: ArrayLike, counts_per_revolution: int) -> Counts:
    """Round angles to encoder counts.

    Args:
        angles: rad, any shape.
        counts_per_revolution: Encoder counts per turn.

    Returns:
        Counts, of the same shape; half a count rounds to the even one.
    """
    turns = np.asarray(angles, dtype=np.float64) / (2 * math.pi)
    return np.rint(turns * counts_per_revolution).astype(np.int64)


def to_angles(counts: ArrayLike, counts_per_revolution: int) -> Floats:
    """Return the angles of encoder counts [rad], of the same shape."""
    return np.asarray(counts, dtype=np.float64) * (2 * math.pi / counts_per_revolution)


class Cubics(NamedTuple):
    """p(u) = p0 + p1 u + p2 u^2 + p3 u^3 with u from 0 to 1; arrays of shape (m, 2)."""

    p0: Floats
    """rad."""
    p1: Floats
    p2: Floats
    p3: Floats
    span: Floats
    """s, of each segment; shape (m, 1)."""


class Extremes(NamedTuple):
    """The extremes of each joint over a motion; arrays of shape (2,)."""

    low: Floats
    """rad."""
    high: Floats
    """rad."""
    speed: Floats
    """rad/s."""
    acceleration: Floats
    """rad/s^2."""
    jerk: Floats
    """rad/s^3."""


def segment_cubics(segments: Segments, counts_per_radian: float, period: float) -> Cubics:
    """Return the cubics with the segments' positions and velocities at their ends."""
    before = segments.start + np.cumsum(segments.steps, axis=0) - segments.steps
    span = segments.samples[:, None].astype(np.float64) * period
    ends = np.vstack([[0, 0], segments.velocities])
    v0, v1 = ends[:-1] * span, ends[1:] * span
    step = segments.steps
    p2, p3 = 3 * step - 2 * v0 - v1, v0 + v1 - 2 * step
    p0, p1, p2, p3 = (term / counts_per_radian for term in (before, v0, p2, p3))
    return Cubics(p0, p1, p2, p3, span)


def evaluate(cubics: Cubics, u: Floats) -> Motion:
    """Return the joints' motion [rad] at u from 0 to 1, which broadcasts with the cubics."""
    p0, p1, p2, p3, span = cubics
    c2, c3 = 2 * p2, 3 * p3
    return Motion(
        p0 + ((p3 * u + p2) * u + p1) * u,
        ((c3 * u + c2) * u + p1) / span,
        (2 * c3 * u + c2) / span**2,
    )


def motion_at(segments: Segments, cubics: Cubics, ticks: Floats | Counts) -> Motion:
    """Return the joints' motion [rad] that a controller executes, arrays (n, 2).

    Args:
        segments: As sent to the controller.
        cubics: As `segment_cubics` returns them for the segments.
        ticks: Controller samples from its start, none outside the motion; shape (n,).
    """
    index = np.clip(np.searchsorted(segments.ends, ticks, side="right") - 1, 0, len(segments) - 1)
    u = (ticks - segments.ends[index]) / segments.samples[index]
    return evaluate(Cubics(*(array[index] for array in cubics)), u[:, None])


def extremes(cubics: Cubics) -> Extremes:
    """Return the exact extremes of a motion, including those between knots."""
    p0, p1, p2, p3, span = cubics
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(p2**2 - 3 * p1 * p3)
        # Both roots of p' = 0, in a form without cancellation; nan and inf count as outside.
        q = -(p2 + np.copysign(root, p2))
        turns = [q / (3 * p3), p1 / q]
        bend = _inside(-p2 / (3 * p3))
    ends = [p0, p0 + p1 + p2 + p3]
    reached = np.stack([*ends, *(_at(cubics, u) for u in turns)])
    fastest = np.abs(p1 + 2 * p2 * bend + 3 * p3 * bend**2)
    speeds = np.stack([np.abs(p1), np.abs(p1 + 2 * p2 + 3 * p3), fastest]) / span
    accelerations = np.abs(np.stack([2 * p2, 2 * p2 + 6 * p3])) / span**2
    return Extremes(
        reached.min(axis=(0, 1)),
        reached.max(axis=(0, 1)),
        speeds.max(axis=(0, 1)),
        accelerations.max(axis=(0, 1)),
        np.abs(6 * p3 / span**3).max(axis=0),
    )


def _inside(u: Floats) -> Floats:
    """Return u if it is inside its segment, else 0."""
    return np.where((u > 0) & (u < 1), u, 0.0)


def _at(cubics: Cubics, u: Floats) -> Floats:
    """Return the position at u, or at the segment's start if u is outside."""
    u = _inside(u)
    return cubics.p0 + ((cubics.p3 * u + cubics.p2) * u + cubics.p1) * u
