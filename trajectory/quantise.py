"""From a smooth motion to whole counts and whole samples."""

import numpy as np

from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.jerk import JerkLaw
from sautereau.trajectory.motion import Floats, Motion
from sautereau.trajectory.segments import Counts, Segments

GRAIN = 2
"""Controller samples that every segment lasts a multiple of, as PVT mode wants it."""
STEADY_COUNTS = 20_000
"""Counts that the slower joint moves between knots at steady speed: a knot is rounded by
at most half a count, so longer segments keep the speed better, until the cubic no longer
follows the finger's path: some 100 ms of it at 0.072 m/s are followed to 1e-4."""
LONGEST_SEGMENT = 1024
"""Controller samples that one segment may last."""
SLOW_GRAINS = 2
"""Grains between knots in long stretches of varying speed, such as gestures."""
ROUNDING_SHARE = 0.1
"""1, of the joints' acceleration limit that rounding to counts may take where it varies."""


def sample_times(law: JerkLaw, period: float, limit: int) -> Floats:
    """Return the times [s] of a law's controller samples, an even number of steps.

    Raises:
        TrajectoryError: The law lasts longer than so many segments can.
    """
    longest = limit * LONGEST_SEGMENT * period
    if law.duration > longest:
        raise TrajectoryError(
            f"press: a motion of {law.duration:.4g} s is longer than the {longest:.4g} s that"
            f" {limit} segments of {LONGEST_SEGMENT} samples last (controller.segment_limit);"
            " raise press.return_speed and return_acceleration, or lower press.bottom_hold"
        )
    grains = int(np.ceil(law.duration / period / GRAIN - 1e-9))
    return np.arange(grains * GRAIN + 1, dtype=np.float64) * period


def quantise(
    law: JerkLaw,
    joints: Motion,
    counts_per_radian: float,
    period: float,
    acceleration_limit: float,
    segment_limit: int,
) -> Segments:
    """Round a motion to whole counts, counts a second and samples.

    Positions are rounded, not steps, so that rounding never adds up. Knots lie further
    apart where that is needed to fit into the controller's FIFO.

    Args:
        law: What the joints follow.
        joints: Their motion at every controller sample [rad], arrays (n, 2).
        counts_per_radian: Encoder counts.
        period: s, one controller sample.
        acceleration_limit: rad/s^2, of the joints.
        segment_limit: Segments that the FIFO holds, the one that ends it included.
    """
    exact = joints.position * counts_per_radian
    whole = np.rint(exact)
    # A cubic that misses both its ends by half a count is accelerated by 6 counts / T^2.
    coarse = 6 / counts_per_radian / (ROUNDING_SHARE * acceleration_limit)
    longest = LONGEST_SEGMENT // GRAIN
    grains = int(np.clip(np.ceil(np.sqrt(coarse) / period / GRAIN), 1, longest))
    speed = np.abs(joints.velocity).min(axis=1) * counts_per_radian * period
    missed = np.abs(exact - whole).max(axis=1)
    while True:
        knots = _knots(law, speed, missed, period, grains)
        if len(knots) <= segment_limit or grains >= longest:
            break
        grains += 1
    positions = whole[knots].astype(np.int64)
    velocities = np.rint(joints.velocity[knots] * counts_per_radian).astype(np.int64)
    return Segments(positions[0], np.diff(positions, axis=0), velocities[1:], np.diff(knots))


def _knots(law: JerkLaw, speed: Floats, missed: Floats, period: float, grains: int) -> Counts:
    """Choose the controller samples at which segments meet.

    Knots are close where the speed changes, for the cubic to follow, and far apart at
    steady speed, where rounding would change it; there they go where it happens to be small.

    Args:
        law: What the joints follow.
        speed: Counts a sample of the slower joint, at every controller sample.
        missed: Counts by which rounding moves the joints, at every controller sample.
        period: s, one controller sample.
        grains: Between knots where the speed changes, and at least where it does not.
    """
    last = (len(speed) - 1) // GRAIN
    chosen = {0, last}
    for first, end, steady in _stretches(law):
        start, stop = first / period / GRAIN, end / period / GRAIN
        if not steady:
            low, high = int(start), min(last, int(np.ceil(stop - 1e-9)))
            # A long stretch varies slowly, and longer segments are rounded less.
            apart = max(grains, min(SLOW_GRAINS, (high - low) // 16))
            pieces = int(np.ceil((high - low) / apart))
            chosen |= set(np.linspace(low, high, pieces + 1).astype(int).tolist())
            continue
        low, high = int(np.ceil(start - 1e-9)), min(last, int(stop + 1e-9))
        if high > low:
            chosen -= set(range(low + 1, high))
            chosen |= _steady_knots(low, high, speed, missed, grains)
    return GRAIN * np.array(sorted(chosen), dtype=np.int64)


def _stretches(law: JerkLaw) -> list[tuple[float, float, bool]]:
    """Return start and end [s] of stretches of varying and of steady speed."""
    found: list[tuple[float, float, bool]] = []
    for i, jerk in enumerate(law.jerks):
        if law.times[i + 1] == law.times[i]:
            continue
        steady = bool(jerk == 0 and abs(law.states[i, 2]) < 1e-9)
        if found and not steady and not found[-1][2]:
            found[-1] = (found[-1][0], law.times[i + 1], False)
        else:
            found.append((law.times[i], law.times[i + 1], steady))
    return found


def _steady_knots(low: int, high: int, speed: Floats, missed: Floats, grains: int) -> set[int]:
    """Choose the knots, in grains, of a stretch of steady speed."""
    counts = speed[low * GRAIN : high * GRAIN + 1].min()
    wanted = max(float(grains), STEADY_COUNTS / max(counts, 1e-9) / GRAIN)
    span = high - low
    # Knots move by a quarter of a piece at most, so a piece grows by half.
    least = np.ceil(1.5 * span * GRAIN / LONGEST_SEGMENT)
    pieces = int(max(np.ceil(span / wanted - 0.5), least))
    reach = span // pieces // 4
    knots = {low, high}
    for even in np.linspace(low, high, pieces + 1).astype(int)[1:-1].tolist():
        near = np.arange(even - reach, even + reach + 1)
        knots.add(int(near[np.argmin(missed[near * GRAIN])]))
    return knots
