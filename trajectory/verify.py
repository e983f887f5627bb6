"""All checks of a press, on the motion that the controller executes."""

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.trajectory.arm import elbow_sign
from sautereau.trajectory.checks import (
    MOVE_BASE,
    SLOWER_PRESS,
    Check,
    at_least,
    at_most,
    depth_and_stops,
    loads,
    places,
    sample,
    tilt_of_finger,
)
from sautereau.trajectory.expected import Expectation
from sautereau.trajectory.quantise import most_segments
from sautereau.trajectory.segments import Cubics, Extremes, Segments, extremes, segment_cubics

SINGULARITY_MARGIN = np.radians(5.0)  # rad, least distance of joint 2 from straight and from folded


def verify(
    rig: Rig,
    parts: tuple[Segments, Segments, Segments],
    cruise_error: float,
    cruise_limit: float,
    expected: Expectation | None,
) -> tuple[Check, ...]:
    """Check every part of a press.

    Args:
        parts: Segments of approach, press and retreat.
        cruise_error: Dimensionless, of the jack's speed in the cruise.
        cruise_limit: Dimensionless, its limit.
        expected: Expected force against the finger; None for none.
    """
    per_radian = rig.arm.counts_per_revolution / (2 * np.pi)
    period = rig.controller.sample_period
    played = [segment_cubics(part, per_radian, period) for part in parts]
    cubics = Cubics(*map(np.concatenate, zip(*played, strict=True)))
    reached = extremes(cubics)
    start, end = np.cumsum([len(part) for part in parts[:2]]).tolist()
    sampled = sample(rig, cubics, slice(start, end))
    return (
        *_geometry(rig, reached),
        *places(rig, sampled),
        tilt_of_finger(rig, Cubics(*(array[start:end] for array in cubics))),
        *_limits(rig, reached),
        *loads(rig, sampled, expected),
        *depth_and_stops(rig, sampled),
        at_most(
            "cruise speed error",
            cruise_error,
            cruise_limit,
            "1",
            "raise arm.counts_per_revolution or press.speed_tolerance",
        ),
        *_held(rig, parts),
    )


def _held(rig: Rig, parts: tuple[Segments, ...]) -> list[Check]:
    """Check that a controller that stores motions has room for every part."""
    limit = most_segments(rig)
    if limit is None:
        return []
    fix = "shorten the press: raise press.jack_speed or press.return_speed"
    return [at_most("segments, with the end", max(map(len, parts)) + 1, limit, "1", fix)]


def _geometry(rig: Rig, reached: Extremes) -> list[Check]:
    """Check reach, branch and the clearance of the elbow."""
    arm = rig.arm
    bends = elbow_sign(arm) * np.array([reached.low[1], reached.high[1]])
    # The fingertip's distance from the base falls as the elbow bends: |B C|(q2) is monotone.
    l1, l2 = arm.upper_length, arm.lower_length
    far, near = np.sqrt(l1**2 + l2**2 + 2 * l1 * l2 * np.cos(np.sort(np.abs(bends))))
    low, high = reached.low[0], reached.high[0]
    downwards = -np.pi / 2 + 2 * np.pi * np.ceil((low + np.pi / 2) / (2 * np.pi))
    lowest_sine = -1.0 if downwards <= high else min(np.sin(low), np.sin(high))
    elbow = arm.base_z + l1 * lowest_sine
    return [
        at_least("reach", min(l1 + l2 - far, near - abs(l1 - l2)), 0.0, "m", MOVE_BASE),
        at_least(
            "singularity",
            min(bends.min(), (np.pi - bends).min()),
            SINGULARITY_MARGIN,
            "rad",
            f"{MOVE_BASE}, or change arm.elbow: the elbow must stay bent on its own side",
        ),
        at_least(
            "clearance of the elbow",
            elbow,
            rig.key.neighbour_height,
            "m",
            f'{MOVE_BASE}, or set arm.elbow = "up"',
        ),
    ]


def _limits(rig: Rig, reached: Extremes) -> list[Check]:
    """Check each joint against its limits, at samples and between them."""
    arm = rig.arm
    found = []
    for j in (0, 1):
        name = f"joint {j + 1}"
        low, high = arm.lower_limits[j], arm.upper_limits[j]
        alpha, jerk = reached.acceleration[j], reached.jerk[j]
        found += [
            at_least(f"{name} lower limit", reached.low[j], low, "rad", MOVE_BASE),
            at_most(f"{name} upper limit", reached.high[j], high, "rad", MOVE_BASE),
            at_most(f"{name} speed", reached.speed[j], arm.speed_limit, "rad/s", SLOWER_PRESS),
            at_most(f"{name} acceleration", alpha, arm.acceleration_limit, "rad/s^2", SLOWER_PRESS),
            at_most(f"{name} jerk", jerk, arm.jerk_limit, "rad/s^3", SLOWER_PRESS),
        ]
    return found
