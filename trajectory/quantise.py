"""Quantisation of a smooth motion to integer counts and controller samples."""

import math

import numpy as np

from sautereau.rig.capabilities import capabilities_of
from sautereau.rig.schema import Rig
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.motion import Floats, Motion
from sautereau.trajectory.segments import Counts, Segments
from sautereau.trajectory.timing import JerkLaw

GRAIN = 2  # Controller samples; the duration of every segment is a multiple, as PVT mode requires
VELOCITY_GRAIN = 2
"""Counts per second; every velocity at a knot is a multiple, as PVT mode requires."""
STEADY_COUNTS = 20_000
"""Counts moved by the slower joint between knots at constant speed: a knot is rounded by at most
half a count, so longer segments have a smaller error of speed, until the cubic no longer follows
the finger's path: at 0.072 m/s about 100 ms are followed to 1e-4."""
LONGEST_SEGMENT = 1024  # Longest segment in controller samples
SLOW_GRAINS = 2  # Grains between knots in long intervals of varying speed, such as gestures
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


def quantise(rig: Rig, law: JerkLaw, joints: Motion) -> Segments:
    """Round a motion to integer counts, even counts per second and even controller samples.

    Positions are rounded, not steps, so that rounding errors do not accumulate. Knots are placed
    further apart if necessary to fit into the controller's FIFO, final segment included.

    Args:
        joints: Their motion at every controller sample [rad], arrays (n, 2).
    """
    counts_per_radian = rig.arm.counts_per_revolution / (2 * np.pi)
    period = rig.controller.sample_period
    exact = joints.position * counts_per_radian
    rounded = np.rint(exact)
    # A cubic with errors of half a count at both ends has an acceleration error of 6 counts / T^2.
    coarse = 6 / counts_per_radian / (ROUNDING_FRACTION * rig.arm.acceleration_limit)
    longest, limit = LONGEST_SEGMENT // GRAIN, most_segments(rig)
    grains = int(np.clip(np.ceil(np.sqrt(coarse) / period / GRAIN), 1, longest))
    speed = np.abs(joints.velocity).min(axis=1) * counts_per_radian * period
    rounding = np.abs(exact - rounded).max(axis=1)
    while True:
        knots = _knots(law, speed, rounding, period, grains)
        if limit is None or len(knots) <= limit or grains >= longest:
            break
        grains += 1
    positions = rounded[knots].astype(np.int64)
    grains_per_second = joints.velocity[knots] * counts_per_radian / VELOCITY_GRAIN
    velocities = VELOCITY_GRAIN * np.rint(grains_per_second).astype(np.int64)
    return Segments(positions[0], np.diff(positions, axis=0), velocities[1:], np.diff(knots))


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
            apart = max(grains, min(SLOW_GRAINS, (high - low) // 16))
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
