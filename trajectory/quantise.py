"""From a smooth motion to whole counts and samples, and back to what the controller does."""

import numpy as np

from trajectory.motion import Floats, Motion
from trajectory.segments import Counts, Segments
from trajectory.timing import JerkLaw

GRAIN = 2
"""Controller samples that every segment lasts a multiple of, as PVT mode wants it; also
the distance of knots where the jack's speed changes."""
STEADY_COUNTS = 1500
"""Counts that the slower joint moves between knots at steady speed: a knot is rounded by
at most half a count, so a segment's mean speed is wrong by at most one in this many."""
LONGEST_SEGMENT = 1024
"""Controller samples that one segment may last."""


def choose_knots(law: JerkLaw, joint_speed: Floats, period: float) -> Counts:
    """Choose the controller samples at which segments meet.

    Knots are close where the speed changes, for the cubic to follow, and far apart at
    steady speed, where rounding to whole counts would change the speed.

    Args:
        law: The jack's law.
        joint_speed: Counts a sample of the slower joint, at every controller sample; an
            even number of samples lies between the first and the last.
        period: s, one controller sample.

    Returns:
        Sample numbers from 0 to ``len(joint_speed) - 1``, increasing.
    """
    grains = (len(joint_speed) - 1) // GRAIN
    chosen = {0, grains}
    for i, jerk in enumerate(law.jerks):
        first, end = law.times[i] / period / GRAIN, law.times[i + 1] / period / GRAIN
        if jerk != 0 or abs(law.states[i, 2]) > 1e-9:
            chosen |= set(range(int(first), min(grains, int(np.ceil(end))) + 1))
            continue
        start, stop = int(np.ceil(first)), min(grains, int(end))
        if stop <= start:
            continue
        counts = np.abs(joint_speed[start * GRAIN : stop * GRAIN + 1]).min()
        steady = max(1.0, STEADY_COUNTS / max(counts, 1e-9) / GRAIN)
        span = stop - start
        pieces = max(np.ceil(span / steady - 0.5), np.ceil(span * GRAIN / LONGEST_SEGMENT))
        inside = set(range(start + 1, stop))
        chosen = (chosen - inside) | set(
            np.linspace(start, stop, int(pieces) + 1).astype(int).tolist()
        )
    return GRAIN * np.array(sorted(chosen), dtype=np.int64)


def quantise(joints: Motion, knots: Counts, counts_per_radian: float) -> Segments:
    """Round a motion at its knots to whole counts, counts a second and samples.

    Positions are rounded, not steps, so that rounding never adds up.

    Args:
        joints: Joint motion at every controller sample [rad], arrays (n, 2).
        knots: Sample numbers at which segments meet.
        counts_per_radian: Encoder counts.
    """
    positions = np.rint(joints.position[knots] * counts_per_radian).astype(np.int64)
    velocities = np.rint(joints.velocity[knots] * counts_per_radian).astype(np.int64)
    return Segments(positions[0], np.diff(positions, axis=0), velocities[1:], np.diff(knots))


def controller_motion(
    segments: Segments, per_sample: int, counts_per_radian: float, period: float
) -> tuple[Floats, Motion]:
    """Recompute the motion that a controller makes of the segments, by its own cubic.

    Args:
        segments: What is sent.
        per_sample: Points evaluated in each controller sample.
        counts_per_radian: Encoder counts.
        period: s, one controller sample.

    Returns:
        Times [s], shape (n,), and the joints' motion [rad], arrays (n, 2).
    """
    ends = np.concatenate([[0], np.cumsum(segments.samples)])
    ticks = np.arange(segments.total_samples * per_sample + 1) / per_sample
    index = np.clip(np.searchsorted(ends, ticks, side="right") - 1, 0, len(segments) - 1)
    position = segments.start + np.vstack([[0, 0], np.cumsum(segments.steps, axis=0)])
    velocity = np.vstack([[0, 0], segments.velocities])
    span = (segments.samples[index] * period)[:, None]
    u = ((ticks - ends[index]) / segments.samples[index])[:, None]
    step, v0, v1 = segments.steps[index], velocity[index] * span, velocity[index + 1] * span
    # Cubic Hermite on u in [0, 1]: p = p0 + v0 u + c2 u^2 + c3 u^3.
    c2, c3 = 3 * step - 2 * v0 - v1, v0 + v1 - 2 * step
    motion = Motion(
        (position[index] + ((c3 * u + c2) * u + v0) * u) / counts_per_radian,
        ((3 * c3 * u + 2 * c2) * u + v0) / span / counts_per_radian,
        (6 * c3 * u + 2 * c2) / span**2 / counts_per_radian,
    )
    return ticks * period, motion
