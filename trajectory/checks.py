"""Checks of a planned press: a value, its limit and the margin.

Quantities without exact extremes are sampled along every segment, with a bound.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sautereau.rig.capabilities import HomingKind, capabilities_of
from sautereau.rig.quantities import DISPLAYED
from sautereau.rig.schema import Rig
from sautereau.trajectory.arm import elbow_sign, fingertip_motion, fingertip_place, tilt
from sautereau.trajectory.dynamics import gravity_torque, joint_torques
from sautereau.trajectory.expected import Expectation
from sautereau.trajectory.key import (
    carried_force,
    contact_angle,
    key_under_fingertip,
    rise_of_angle,
    surface_axes,
)
from sautereau.trajectory.motion import Floats, Motion, dot
from sautereau.trajectory.quantise import most_segments
from sautereau.trajectory.segments import (
    Cubics,
    Extremes,
    Segments,
    evaluate,
    extremes,
    segment_cubics,
)

MOVE_BASE = "move arm.base_x or arm.base_z"
IN_FELT = "lower press.jack_rise: the key would reach its felt"
SLOWER_PRESS = (
    "lower press.jack_speed, press.run_up_acceleration, run_up_jerk or run_down_acceleration"
)
"""How to fix checks of several kinds that fail."""

SINGULARITY_MARGIN = np.radians(5.0)  # rad, least distance of joint 2 from straight and from folded
INSIDE = np.linspace(0.0, 1.0, 5)  # Points at which each segment is sampled


@dataclass(frozen=True)
class Check:
    """One quantity against its limit."""

    name: str
    value: float
    """In `unit`."""
    limit: float
    """In `unit`."""
    unit: str
    at_least: bool
    """Whether the limit is a minimum; otherwise it is a maximum."""
    how_to_fix: str
    """What to do if the check fails."""

    @property
    def margin(self) -> float:
        """Distance from the limit, in `unit`; negative if the check fails."""
        return self.value - self.limit if self.at_least else self.limit - self.value

    @property
    def holds(self) -> bool:
        """Whether the value is within its limit; NaN never is."""
        return bool(np.isfinite(self.value)) and self.margin >= 0

    def __str__(self) -> str:
        side = "at least" if self.at_least else "at most"
        verdict = "holds" if self.holds else "fails"
        scale, unit = DISPLAYED.get(self.unit, (1.0, self.unit))
        unit = "" if unit == "1" else f" {unit}"
        return (
            f"{self.name}: {self.value * scale:.6g}{unit}, {side} {self.limit * scale:.6g}{unit}:"
            f" {verdict} by {abs(self.margin) * scale:.3g}{unit}"
        )


def at_most(name: str, value: float, limit: float, unit: str, how_to_fix: str) -> Check:
    """Return a check against a maximum."""
    return Check(name, float(value), float(limit), unit, False, how_to_fix)


def at_least(name: str, value: float, limit: float, unit: str, how_to_fix: str) -> Check:
    """Return a check against a minimum."""
    return Check(name, float(value), float(limit), unit, True, how_to_fix)


class Sampled(NamedTuple):
    """The controller's motion at n points, by default `INSIDE`, of m segments; arrays (m, n) and
    (m, n, 2)."""

    joints: Motion
    """rad."""
    centre: Floats
    """m, of the fingertip."""
    angle: Floats
    """rad, of the key under it; negative where the fingertip is above a key at rest."""
    pressing: slice
    """The segments of the press, between approach and retreat."""


def sample(rig: Rig, cubics: Cubics, pressing: slice, inside: Floats = INSIDE) -> Sampled:
    """Sample a motion along every segment."""
    joints = evaluate(Cubics(*(array[:, None] for array in cubics)), inside[:, None])
    centre = fingertip_place(rig.arm, joints.position)
    return Sampled(joints, centre, _angle(rig, centre), pressing)


def places(rig: Rig, sampled: Sampled) -> list[Check]:
    """Check the contact point on the key, and the height of the hovering fingertip."""
    key = rig.key
    centre, angle = sampled.centre[sampled.pressing], sampled.angle[sampled.pressing]
    # The way from the pin has a kink at lift-off; along the key and above it each is smooth.
    tangent, _ = surface_axes(angle)
    between = _bends(angle)
    ways = [
        -dot(centre, tangent)[angle.max(axis=-1) >= -between],
        -centre[angle.min(axis=-1) <= between, :, 0],
    ]
    # Near the pin the way along the key is no smooth quantity, but its square is.
    square = dot(centre, centre) - (key.surface_height + rig.arm.fingertip_radius) ** 2
    squares = [square[angle.max(axis=-1) >= -between], ways[1] * np.abs(ways[1])]
    least = min(each.min() - _bend(each) for each in squares if len(each))
    near = float(np.sign(least) * np.sqrt(np.abs(least)))
    far = max(way.max() + _bend(way) for way in ways if len(way))
    hover = min(sampled.centre[0, 0, 1], sampled.centre[-1, -1, 1]) - rig.arm.fingertip_radius
    return [
        at_least(
            "contact on the key",
            min(near, key.front_arm - far),
            0.0,
            "m",
            f'{MOVE_BASE}, lower key.press_arm, or set press.hold = "point":'
            " the finger slides off the key",
        ),
        at_least(
            "clearance of the hovering fingertip",
            hover,
            key.neighbour_height,
            "m",
            "raise press.hover: the fingertip would touch the neighbouring keys",
        ),
    ]


def tilt_of_finger(rig: Rig, press: Cubics) -> Check:
    """Check the tilt of the finger against the key's normal during the press."""
    # It bends most in the long segments of the cruise: 17 points there give a bound within 1 %.
    sampled = sample(rig, press, slice(None), np.linspace(0.0, 1.0, 17))
    leaning = tilt(np.maximum(sampled.angle, 0.0), sampled.joints.position)
    return at_most(
        "tilt of the finger",
        (np.abs(leaning).max(axis=-1) + _bends(leaning)).max(),
        rig.arm.tilt_limit,
        "rad",
        f'{MOVE_BASE} as `mount` suggests, set press.hold = "normal", or raise arm.tilt_limit:'
        " the transducer measures the force along the finger only",
    )


def loads(rig: Rig, sampled: Sampled, expected: Expectation | None) -> list[Check]:
    """Check the torques for inertia and weight, with an expected force those of the key too."""
    free = joint_torques(rig.arm, sampled.joints)
    peaks = [_peak(free[..., j]) for j in (0, 1)]
    if expected is not None:
        peaks = _loaded(rig, sampled, free, expected)
    felt = _depth(rig, sampled.angle).max() > rig.key.dip
    how_to_fix = IN_FELT if felt else f"{SLOWER_PRESS}, or {MOVE_BASE}"
    return [
        at_most(f"joint {j + 1} torque", peaks[j], rig.arm.torque_limit, "N*m", how_to_fix)
        for j in (0, 1)
    ]


def standing(rig: Rig, sampled: Sampled) -> list[Check]:
    """Check the torques that hold the links' weight at home and above the key.

    A joint that stands at a larger fraction of its torque than `encoder_loss_torque` counts as one
    that has lost its encoder, and homing allows `home_torque` only.
    """
    controller = rig.controller
    if capabilities_of(rig).homing is not HomingKind.SWITCHES:
        return []
    most = rig.arm.torque_limit * controller.encoder_loss_torque
    raised = "raise controller.encoder_loss_torque"
    rests = (
        ("home", rig.arm.home_angles, controller.home_torque, f"{raised} or home_torque"),
        ("rest above the key", sampled.joints.position[0, 0], 1.0, f"{raised}, or {MOVE_BASE}"),
    )
    return [
        at_most(f"joint {j} torque, at {place}", abs(weight), most * fraction, "N*m", fix)
        for place, joints, fraction, fix in rests
        for j, weight in enumerate(gravity_torque(rig.arm, np.array(joints)), 1)
    ]


def depth_and_stops(rig: Rig, sampled: Sampled) -> list[Check]:
    """Check that the key does not reach its felt, and that a stop at any time is safe."""
    key, arm = rig.key, rig.arm
    position, velocity, _ = sampled.joints
    # Each joint decelerates independently, at its acceleration limit, as in a controller's stop.
    speed = np.abs(velocity)
    slower = np.maximum(speed[..., 0], speed[..., 1])[..., None]
    stopped = np.linspace(0.25, 1.0, 4)[:, None, None, None]  # Fractions of the slower one's stop
    left = np.maximum(speed - stopped * slower, 0.0)
    turned = np.copysign((speed**2 - left**2) / (2 * arm.acceleration_limit), velocity)
    stopping = position + turned
    stopped, spare = stopping[-1], np.inf
    for j in (0, 1):
        joint = stopped[..., j]
        room = min(joint.min() - arm.lower_limits[j], arm.upper_limits[j] - joint.max())
        spare = min(spare, room - _bend(joint))
    depth = _depth(rig, sampled.angle)
    sinking = _depth(rig, _angle(rig, fingertip_place(arm, stopping)))
    slack = _bend(sinking) + _bend(np.stack([depth, *sinking], -1))
    return [
        at_most(
            "depth of the key",
            max(depth.max() + _bend(depth), 0.0),
            key.dip,
            "m",
            IN_FELT,
        ),
        at_most(
            "depth of the key after a stop",
            max(depth.max() + slack, sinking.max() + slack, 0.0),
            key.dip,
            "m",
            "lower press.jack_speed or jack_rise, or raise arm.acceleration_limit",
        ),
        at_least("joint margin after a stop", spare, 0.0, "rad", MOVE_BASE),
    ]


def _loaded(rig: Rig, sampled: Sampled, free: Floats, expected: Expectation) -> list[float]:
    """Bound the torques with the force on the key: free - force x lever, by virtual work.

    The force may peak between samples, so each sample takes the largest force up to its
    neighbours.
    """
    pressing = sampled.pressing
    angle = np.maximum(sampled.angle[pressing], 0.0)
    joints = Motion(*(array[pressing] for array in sampled.joints))
    _, normal = surface_axes(angle)
    lever = free[pressing] - joint_torques(rig.arm, joints, normal)
    rise = rise_of_angle(rig.key, angle)
    around = np.pad(rise, ((0, 0), (1, 1)), mode="edge")
    around = np.stack([around[:, :-2], rise, around[:, 2:]])
    slack = _bend(rise)
    against = expected.range_between(around.min(axis=0) - slack, around.max(axis=0) + slack)
    centre = fingertip_motion(rig.arm, joints)
    motion = key_under_fingertip(rig.key, rig.arm.fingertip_radius, centre)
    forces = [carried_force(rig, motion, force) for force in against]
    most, bent = max(force.max() for force in forces), _bend(carried_force(rig, motion))
    peaks = []
    for j in (0, 1):
        bare, arm = free[..., j], lever[..., j]
        loaded = max(np.abs(bare[pressing] - force * arm).max() for force in forces)
        slack = _bend(bare) + most * _bend(arm) + bent * np.abs(arm).max()
        peaks.append(max(_peak(bare), float(loaded + slack)))
    return peaks


def _angle(rig: Rig, centre: Floats) -> Floats:
    """Return the angle [rad] of a key in contact with the fingertip, negative above rest."""
    return contact_angle(rig.key.surface_height + rig.arm.fingertip_radius, centre)


def _depth(rig: Rig, angle: Floats) -> Floats:
    """Return the depth [m] of the pressing point below rest."""
    key = rig.key
    lowered = key.press_arm * np.sin(angle) - key.surface_height * np.cos(angle)
    return lowered + key.surface_height


def _peak(values: Floats) -> float:
    """Bound the largest magnitude of a smooth quantity from its samples in each segment."""
    return float(max(values.max(), -values.min())) + _bend(values)


def _bend(values: Floats) -> float:
    """Bound the excess of a smooth quantity over its samples along the last axis, anywhere."""
    return float(_bends(values).max())


def _bends(values: Floats) -> Floats:
    """Bound the excess of a smooth quantity over its samples along the last axis.

    Between samples at a distance h it is at most h^2/8 times the second derivative. A quarter of
    the largest second difference is used: twice that bound, in case the derivative varies.
    """
    seconds = values[..., 2:] - 2 * values[..., 1:-1] + values[..., :-2]
    return np.abs(seconds).max(axis=-1) / 4


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
        *standing(rig, sampled),
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
