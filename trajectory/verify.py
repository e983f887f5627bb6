"""Every check of a press, on the motion that the controller will really make."""

from typing import NamedTuple

import numpy as np

from rig.schema import Rig
from trajectory.arm import elbow_sign, fingertip_motion, fingertip_place
from trajectory.checks import Check, at_least, at_most
from trajectory.cubic import Cubics, Extremes, evaluate, extremes, segment_cubics
from trajectory.dynamics import joint_torques
from trajectory.expected import Expectation
from trajectory.key import rise_of_angle, surface_axes
from trajectory.motion import Floats, Motion
from trajectory.segments import Segments

SINGULARITY_MARGIN = np.radians(5.0)
"""rad, that joint 2 must stay from straight or folded."""
INSIDE = np.linspace(0.0, 1.0, 5)
"""Places in each segment at which what has no exact extreme is evaluated."""
STOP_SHARES = np.linspace(0.25, 1.0, 4)
"""Shares of a decelerated stop at which it is looked at."""
MOVE_BASE = "move arm.base_x or arm.base_z"
SOFTER = "lower press.jack_speed, press.run_up_acceleration, run_up_jerk or run_down_acceleration"


class Motions(NamedTuple):
    """What the controller is sent, part by part."""

    approach: Segments
    press: Segments
    retreat: Segments


class Sampled(NamedTuple):
    """The controller's motion at `INSIDE` of every segment; shapes (m, k, ...)."""

    joints: Motion
    centre: Motion
    """m, of the fingertip."""
    pressing: Floats
    """1 in the segments of the press, 0 on the ways there and back; shape (m, 1)."""


def verify(
    rig: Rig,
    motions: Motions,
    cruise_error: float,
    contact_from_pin: tuple[float, float],
    expected: Expectation | None,
) -> tuple[Check, ...]:
    """Check every part of a press.

    Args:
        rig: The bench.
        motions: What the controller is sent.
        cruise_error: 1, of the jack's speed in the cruise.
        contact_from_pin: m, least and largest distance of the contact from the pin.
        expected: What the finger meets; None for nothing.
    """
    per_radian = rig.arm.counts_per_revolution / (2 * np.pi)
    period = rig.controller.sample_period
    parts = [segment_cubics(part, per_radian, period) for part in motions]
    cubics = Cubics(*map(np.concatenate, zip(*parts, strict=True)))
    reached = extremes(cubics)
    pressing = np.repeat([0.0, 1.0, 0.0], [len(part) for part in motions])[:, None]
    sampled = _sample(rig, cubics, pressing)
    return (
        *_geometry(rig, reached, contact_from_pin),
        *_limits(rig, reached),
        *_loads(rig, sampled, expected),
        *_depth_and_stops(rig, sampled),
        at_most(
            "cruise speed error",
            cruise_error,
            rig.press.speed_tolerance,
            "1",
            "raise arm.counts_per_revolution or press.speed_tolerance",
        ),
        at_most(
            "segments",
            max(len(part) for part in motions) + 1,
            rig.controller.segment_limit,
            "1",
            "shorten the press: raise press.jack_speed or press.return_speed",
        ),
    )


def _geometry(rig: Rig, reached: Extremes, contact: tuple[float, float]) -> list[Check]:
    """Check reach, branch, the contact's place and the clearance of elbow and hover."""
    arm, key = rig.arm, rig.key
    bends = elbow_sign(arm) * np.array([reached.low[1], reached.high[1]])
    # The fingertip's distance from the base falls as the elbow bends: |B C|(q2) is monotone.
    l1, l2 = arm.upper_length, arm.lower_length
    far, near = np.sqrt(l1**2 + l2**2 + 2 * l1 * l2 * np.cos(np.sort(np.abs(bends))))
    low, high = reached.low[0], reached.high[0]
    lowest_sine = -1.0 if _contains(low, high, -np.pi / 2) else min(np.sin(low), np.sin(high))
    elbow = arm.base_z + l1 * lowest_sine
    hover = key.surface_height + rig.press.hover
    return [
        at_least("reach", min(l1 + l2 - far, near - abs(l1 - l2)), 0.0, "m", MOVE_BASE),
        at_least(
            "singularity",
            min(bends.min(), (np.pi - bends).min()),
            SINGULARITY_MARGIN,
            "rad",
            f"{MOVE_BASE}, or change arm.elbow: the elbow must stay bent to its own side",
        ),
        at_least(
            "contact on the key",
            min(contact[0], key.front_arm - contact[1]),
            0.0,
            "m",
            f'{MOVE_BASE}, or set press.hold = "point": the finger slides off the key',
        ),
        at_least(
            "clearance of the hovering fingertip",
            hover,
            key.neighbour_height,
            "m",
            "raise press.hover: the fingertip would touch the neighbouring keys on its way",
        ),
        at_least(
            "clearance of the elbow",
            elbow,
            key.neighbour_height,
            "m",
            f'{MOVE_BASE}, or set arm.elbow = "up"',
        ),
    ]


def _limits(rig: Rig, reached: Extremes) -> list[Check]:
    """Check each joint against its limits, between knots too."""
    arm = rig.arm
    found = []
    for j in (0, 1):
        name = f"joint {j + 1}"
        low, high = arm.lower_limits[j], arm.upper_limits[j]
        spin, jerk = reached.acceleration[j], reached.jerk[j]
        found += [
            at_least(f"{name} lower limit", reached.low[j], low, "rad", MOVE_BASE),
            at_most(f"{name} upper limit", reached.high[j], high, "rad", MOVE_BASE),
            at_most(f"{name} speed", reached.speed[j], arm.speed_limit, "rad/s", SOFTER),
            at_most(f"{name} acceleration", spin, arm.acceleration_limit, "rad/s^2", SOFTER),
            at_most(f"{name} jerk", jerk, arm.jerk_limit, "rad/s^3", SOFTER),
        ]
    return found


def _loads(rig: Rig, sampled: Sampled, expected: Expectation | None) -> list[Check]:
    """Check the torques of arm, weight and the expected force on the finger."""
    force = None
    if expected is not None:
        angle = _angle(rig, sampled.centre.position)
        _, normal = surface_axes(angle)
        push = sampled.pressing * expected.force_at(rise_of_angle(rig.key, angle))
        force = push[..., None] * normal
    torques = joint_torques(rig.arm, sampled.joints, force)
    remedy = f"{SOFTER}, or {MOVE_BASE}"
    return [
        at_most(
            f"joint {j + 1} torque", _peak(torques[..., j]), rig.arm.torque_limit, "N*m", remedy
        )
        for j in (0, 1)
    ]


def _depth_and_stops(rig: Rig, sampled: Sampled) -> list[Check]:
    """Check that the key stays off its felt, and that a stop from anywhere stays safe."""
    key, arm = rig.key, rig.arm
    # Each joint brakes by itself, at its acceleration limit, as the controller's stop does.
    speed = sampled.joints.velocity
    braking = speed * np.abs(speed) / (2 * arm.acceleration_limit)
    shares = (1 - (1 - STOP_SHARES) ** 2)[:, None, None, None]
    stopping = sampled.joints.position + shares * braking
    sunk = _peak(_depth(rig, fingertip_place(arm, stopping)))
    low, high = stopping.min(axis=(0, 1, 2)), stopping.max(axis=(0, 1, 2))
    spare = min((low - arm.lower_limits).min(), (arm.upper_limits - high).min())
    return [
        at_most(
            "depth of the key",
            _peak(_depth(rig, sampled.centre.position)),
            key.dip,
            "m",
            "lower press.jack_rise: the key would run into its felt",
        ),
        at_most(
            "depth of the key after a stop",
            sunk,
            key.dip,
            "m",
            "lower press.jack_speed or jack_rise, or raise arm.acceleration_limit",
        ),
        at_least("joints after a stop", spare, 0.0, "rad", MOVE_BASE),
    ]


def _sample(rig: Rig, cubics: Cubics, pressing: Floats) -> Sampled:
    m, k = len(cubics.span), len(INSIDE)
    joints = evaluate(cubics, np.repeat(np.arange(m), k), np.tile(INSIDE, m))
    shaped = Motion(*(array.reshape(m, k, 2) for array in joints))
    return Sampled(shaped, fingertip_motion(rig.arm, shaped), pressing)


def _angle(rig: Rig, centre: Floats) -> Floats:
    """Return the angle [rad] of a key that touches the fingertip; above the key, at rest."""
    height = rig.key.surface_height + rig.arm.fingertip_radius
    x, z = centre[..., 0], centre[..., 1]
    along = np.sqrt(np.maximum(x**2 + z**2 - height**2, 0.0))
    return np.maximum(np.arctan2(-x, z) - np.arctan2(along, height), 0.0)


def _depth(rig: Rig, centre: Floats) -> Floats:
    """Return how far [m] the pressing point of the touched key has gone down."""
    key, angle = rig.key, _angle(rig, centre)
    lowered = key.press_arm * np.sin(angle) - key.surface_height * np.cos(angle)
    return lowered + key.surface_height


def _peak(values: Floats) -> float:
    """Bound the largest magnitude of a smooth quantity from its samples in each segment.

    Between samples a distance h apart it exceeds them by h^2/8 of its second derivative
    at most, which the largest second difference stands for.
    """
    bend = np.abs(np.diff(values, 2, axis=-1)).max(initial=0.0)
    return float(np.abs(values).max() + bend / 8)


def _contains(low: float, high: float, angle: float) -> bool:
    """Whether low to high passes an angle, in any turn."""
    turns = np.ceil((low - angle) / (2 * np.pi))
    return bool(angle + 2 * np.pi * turns <= high)
