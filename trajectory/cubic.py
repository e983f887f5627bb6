"""The controller's cubics of segments, their evaluation and their exact extremes."""

from typing import NamedTuple

import numpy as np

from sautereau.trajectory.motion import Floats, Motion
from sautereau.trajectory.segments import Segments


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


def controller_motion(
    segments: Segments, per_sample: int, counts_per_radian: float, period: float
) -> tuple[Floats, Motion]:
    """Return the motion that a controller executes for segments, by cubic interpolation.

    Args:
        segments: As sent to the controller.
        per_sample: Points evaluated in each controller sample.
        counts_per_radian: Encoder counts.
        period: s, one controller sample.

    Returns:
        Times [s], shape (n,), and the joints' motion [rad], arrays (n, 2).
    """
    ticks = np.arange(segments.total_samples * per_sample + 1) / per_sample
    cubics = segment_cubics(segments, counts_per_radian, period)
    return ticks * period, motion_at(segments, cubics, ticks)


def motion_at(segments: Segments, cubics: Cubics, ticks: Floats) -> Motion:
    """Return the joints' motion [rad] at controller samples from its start, arrays (n, 2).

    Args:
        segments: As sent to the controller.
        cubics: As `segment_cubics` returns them for the segments.
        ticks: Controller samples, none outside the motion; shape (n,).
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
