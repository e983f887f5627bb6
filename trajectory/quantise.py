"""Quantisation of a smooth motion to integer counts and controller samples."""

import math
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from sautereau.rig.capabilities import capabilities_of
from sautereau.rig.schema import Rig
from sautereau.trajectory.arm import jack_under_finger
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.motion import Floats, Motion
from sautereau.trajectory.segments import Counts, Segments
from sautereau.trajectory.timing import JerkLaw, PressLaw

GRAIN = 2  # Controller samples; the duration of every segment is a multiple, as PVT mode requires
STEADY_COUNTS = 20_000
"""Counts moved by the slower joint between knots at constant speed: a knot is rounded by at most
half a count, so longer segments have a smaller error of speed, until the cubic no longer follows
the finger's path: at 0.072 m/s about 100 ms are followed to 1e-4."""
LONGEST_SEGMENT = 1024  # Longest segment in controller samples
ROUNDING_FRACTION = 0.1
"""Dimensionless, largest acceleration by rounding to counts, relative to the joints' limit."""


def most_segments(rig: Rig) -> int | None:
    """Return the segments that the controller holds; None where it holds no motion."""
    return rig.controller.segment_limit if capabilities_of(rig).preloaded else None


def sample_times(rig: Rig, law: JerkLaw) -> Floats:
    """Return the times [s] of a law's controller samples, an even number of steps.

    Raises:
        TrajectoryError: The law is longer than the longest possible segments.
    """
    period, limit = rig.controller.sample_period, most_segments(rig)
    longest = math.inf if limit is None else limit * LONGEST_SEGMENT * period
    if law.duration > longest:
        raise TrajectoryError(
            f"press: a motion of {law.duration:.4g} s is longer than the {longest:.4g} s of"
            f" {limit} segments of {LONGEST_SEGMENT} samples (controller.segment_limit);"
            " raise press.return_speed and return_acceleration, or lower press.bottom_hold"
        )
    grains = int(np.ceil(law.duration / period / GRAIN - 1e-9))
    return np.arange(grains * GRAIN + 1, dtype=np.float64) * period


def quantise(rig: Rig, law: JerkLaw, joints: Motion, stroke: PressLaw | None = None) -> Segments:
    """Round a motion to integer counts, even counts per second and even controller samples.

    Positions are rounded, not steps, so that rounding errors do not accumulate. Knots are placed
    further apart if necessary to fit into the controller's FIFO, final segment included.

    Args:
        law: Of the jack's rise, or of the height in an approach.
        joints: Their motion at every controller sample [rad], arrays (n, 2).
        stroke: A press, to search those knots in its stroke that give the smallest error of the
            jack's speed, see `_followed`; None not to.
    """
    counts_per_radian = rig.arm.counts_per_revolution / (2 * np.pi)
    period = rig.controller.sample_period
    exact = joints.position * counts_per_radian
    rounded = np.rint(exact)
    rates = 2 * np.rint(joints.velocity * counts_per_radian / 2)  # Even, as PVT mode requires
    # A cubic with errors of half a count at both ends has an acceleration error of 6 counts / T^2.
    coarse = 6 / counts_per_radian / (ROUNDING_FRACTION * rig.arm.acceleration_limit)
    longest, limit = LONGEST_SEGMENT // GRAIN, most_segments(rig)
    least = grains = int(np.clip(np.ceil(np.sqrt(coarse) / period / GRAIN), 1, longest))
    speed = np.abs(joints.velocity).min(axis=1) * counts_per_radian * period
    rounding = np.abs(exact - rounded).max(axis=1)
    while True:
        knots = _knots(law, speed, rounding, period, grains)
        if stroke is not None:
            sent = Motion(rounded / counts_per_radian, rates / counts_per_radian, 0 * rates)
            bent = (rounded - exact) / counts_per_radian
            parts = stroke.start, stroke.cruise_start, stroke.cruise_end, stroke.bottom
            edges = np.ceil(np.array(parts) / period / GRAIN - 1e-9)
            edges[2] = np.floor(parts[2] / period / GRAIN + 1e-9)  # the cruise ends with a segment
            edges = np.unique(np.minimum(edges, (len(bent) - 1) // GRAIN).astype(np.int64))
            for low, high in pairwise(edges.tolist()):
                knots = _followed(rig, law, low, high, knots, sent, bent, grains - least + 1)
        if limit is None or len(knots) <= limit or grains >= longest:
            break
        grains += 1
    positions = rounded[knots].astype(np.int64)
    velocities = rates[knots].astype(np.int64)
    return Segments(positions[0], np.diff(positions, axis=0), velocities[1:], np.diff(knots))


def _followed(
    rig: Rig,
    law: JerkLaw,
    low: int,
    high: int,
    knots: Counts,
    sent: Motion,
    bent: Floats,
    least: int,
) -> Counts:
    """Replace the knots of a part by those with the least squared error of the jack's speed.

    In a segment the jack follows the cubic between the rises and speeds that the rounded joints
    give it at the two knots. A short segment follows the law, a long one is disturbed less by
    rounding, and one between two knots with equal rounding errors is not disturbed at all. The best
    sequence follows from the errors of all possible segments by dynamic programming.

    Args:
        low: Grains, its first knot.
        high: Grains, its last knot.
        knots: Controller samples; those in the part are replaced.
        sent: Joints rounded at every controller sample [rad], arrays (n, 2).
        bent: rad, by which they are rounded.
        least: Grains, of the shortest segment.
    """
    period = rig.controller.sample_period
    inside = slice(low * GRAIN, high * GRAIN + 1)
    planned = law.at(np.arange(inside.start, inside.stop, dtype=np.float64) * period).velocity
    sent, bent = Motion(*(array[inside][::GRAIN] for array in sent)), bent[inside][::GRAIN]
    jack = jack_under_finger(rig, sent)
    n, total, best = high - low, math.inf, np.zeros(0, np.int64)
    errors = np.full((min(n, LONGEST_SEGMENT // GRAIN), n), np.inf)
    for length in range(least, len(errors) + 1):
        span, u = length * GRAIN * period, np.linspace(0, 1, length * GRAIN + 1)
        mean = (jack.position[length:] - jack.position[:-length]) / span
        ends = jack.velocity[:-length], jack.velocity[length:]
        shape = [6 * u * (1 - u), (1 - u) * (1 - 3 * u), u * (3 * u - 2)]  # of a cubic's slope
        speed = sum(
            np.outer(value, slope) for value, slope in zip([mean, *ends], shape, strict=True)
        )
        error = speed - sliding_window_view(planned, len(u))[::GRAIN]
        jolt = 6 * np.abs(bent[length:] - bent[:-length]).max(axis=1) / span**2
        smooth = jolt <= ROUNDING_FRACTION * rig.arm.acceleration_limit
        squares = np.asarray(np.trapezoid(error**2, axis=1))
        errors[length - 1, : len(squares)] = np.where(smooth, squares, np.inf)
        # Twice as long ones each time, until they give no better sequence.
        if length & (length - 1) == 0 or length == len(errors):
            before = total
            total, found = _least(errors[:length])
            if total < before:
                best = found
            elif np.isfinite(total):
                break
    if not len(best):
        return knots
    outside = knots[(knots < inside.start) | (knots >= inside.stop)]
    return np.union1d(outside, (low + best) * GRAIN)


def _least(errors: Floats) -> tuple[float, Counts]:
    """Return the least sum of errors of consecutive segments, and their ends from 0.

    Args:
        errors: Of the segment of length l + 1 that starts at i; shape (longest, n).
    """
    longest, n = errors.shape
    sums, steps = np.full(n + 1, np.inf), np.zeros(n + 1, np.int64)
    sums[0] = 0.0
    for end in range(1, n + 1):
        lengths = np.arange(1, min(longest, end) + 1)
        of_each = sums[end - lengths] + errors[lengths - 1, end - lengths]
        steps[end] = lengths[np.argmin(of_each)]
        sums[end] = of_each[steps[end] - 1]
    ends = [n]
    while ends[-1] > 0:
        ends.append(ends[-1] - steps[ends[-1]])
    return float(sums[n]), np.array(ends[::-1])


def _knots(law: JerkLaw, speed: Floats, rounding: Floats, period: float, grains: int) -> Counts:
    """Choose the controller samples of the knots between segments.

    Knots are close together where the speed varies, so that the cubic follows, and far apart at
    constant speed, which rounding would disturb; there they are placed at small rounding errors.

    Args:
        speed: Counts per sample of the slower joint, at every controller sample.
        rounding: Rounding error in counts, at every controller sample.
        period: s, one controller sample.
        grains: Between knots at varying speed, and the minimum at constant speed.
    """
    last = (len(speed) - 1) // GRAIN
    chosen = {0, last}
    for first, end, steady in _intervals(law):
        start, stop = first / period / GRAIN, end / period / GRAIN
        if not steady:
            low, high = int(start), min(last, int(np.ceil(stop - 1e-9)))
            # A long interval varies slowly, and longer segments have a smaller rounding error.
            apart = max(grains, min(2, (high - low) // 16))
            pieces = int(np.ceil((high - low) / apart))
            chosen |= set(np.linspace(low, high, pieces + 1).astype(int).tolist())
            continue
        low, high = int(np.ceil(start - 1e-9)), min(last, int(stop + 1e-9))
        if high > low:
            chosen -= set(range(low + 1, high))
            chosen |= _steady_knots(low, high, speed, rounding, grains)
    return GRAIN * np.array(sorted(chosen), dtype=np.int64)


def _intervals(law: JerkLaw) -> list[tuple[float, float, bool]]:
    """Return start and end [s] of each interval, and whether its speed is constant."""
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


def _steady_knots(low: int, high: int, speed: Floats, rounding: Floats, grains: int) -> set[int]:
    """Choose the knots, in grains, of an interval of constant speed."""
    counts = speed[low * GRAIN : high * GRAIN + 1].min()
    length = max(float(grains), STEADY_COUNTS / max(counts, 1e-9) / GRAIN)
    span = high - low
    # Knots move by a quarter of a piece at most, so a piece grows by half.
    least = np.ceil(1.5 * span * GRAIN / LONGEST_SEGMENT)
    pieces = int(max(np.ceil(span / length - 0.5), least))
    reach = span // pieces // 4
    knots = {low, high}
    for even in np.linspace(low, high, pieces + 1).astype(int)[1:-1].tolist():
        near = np.arange(even - reach, even + reach + 1)
        knots.add(int(near[np.argmin(rounding[near * GRAIN])]))
    return knots
