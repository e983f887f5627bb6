"""Plan one press: from the jack's law to checked, quantised joint motion."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rig.schema import Rig
from trajectory.arm import (
    elbow_sign,
    fingertip_motion,
    joints_holding_normal,
    joints_holding_point,
    reach_margins,
    tilt,
)
from trajectory.checks import Check, at_least, at_most
from trajectory.counts import to_counts
from trajectory.errors import TrajectoryError
from trajectory.key import jack_motion, key_motion, key_under_fingertip, point_on_key
from trajectory.motion import Floats, Motion
from trajectory.quantise import (
    GRAIN,
    LONGEST_SEGMENT,
    choose_knots,
    controller_motion,
    quantise,
)
from trajectory.segments import Counts, Segments
from trajectory.timing import PressLaw, press_law

FINE = 16
"""Points in each controller sample at which the quantised motion is checked."""
SINGULARITY_MARGIN = np.radians(5.0)
"""rad, that joint 2 must stay from straight or folded."""


@dataclass(frozen=True)
class Trajectory:
    """One press on one time base, every array of the same first length."""

    law: PressLaw
    time: Floats
    """s from the start of motion, at every controller sample; shape (n,)."""
    rise: Motion
    """Of the jack [m]; shape (n,)."""
    angle: Motion
    """Of the key [rad]; shape (n,)."""
    fingertip: Motion
    """Of the fingertip's centre [m]; shape (n, 2)."""
    joints: Motion
    """rad; shape (n, 2)."""
    tilt: Floats
    """rad, of link 2 against the key's normal; shape (n,)."""
    slide: Floats
    """m, of the contact along the key; shape (n,)."""
    segments: Segments
    """What the controller is sent."""
    cruise: tuple[float, float]
    """s, start and end of the cruise in the quantised motion."""
    cruise_speed: float
    """m/s, mean of the quantised motion over the cruise."""
    cruise_error: float
    """1, largest departure of the quantised speed in the cruise from the planned one."""
    home: Counts
    """Counts, joint positions at the home switches; shape (2,)."""
    hover: Counts
    """Counts, joint positions with the fingertip above the key; shape (2,)."""
    checks: tuple[Check, ...]


def plan_press(rig: Rig) -> Trajectory:
    """Plan the press of a rig.

    Raises:
        TrajectoryError: Lists every check that fails, with what would mend it.
    """
    trajectory = draft_press(rig)
    failed = [check for check in trajectory.checks if not check.holds]
    if failed:
        lines = [f"{check}; {check.remedy}" for check in failed]
        raise TrajectoryError("the press cannot be made:\n  " + "\n  ".join(lines))
    return trajectory


def draft_press(rig: Rig) -> Trajectory:
    """Plan the press of a rig whether or not its checks hold.

    Raises:
        TrajectoryError: There is no such motion at all: no cruise, or out of reach.
    """
    law = press_law(rig.press)
    period = rig.controller.sample_period
    longest = rig.controller.segment_limit * LONGEST_SEGMENT * period
    if law.law.duration > longest:
        raise TrajectoryError(
            f"press: lasts {law.law.duration:.4g} s, and {rig.controller.segment_limit} segments of"
            f" {LONGEST_SEGMENT} samples (controller.segment_limit) last {longest:.4g} s;"
            " raise press.return_speed and return_acceleration, or lower press.bottom_hold"
        )
    grains = int(np.ceil(law.law.duration / period / GRAIN))
    time = np.arange(grains * GRAIN + 1, dtype=np.float64) * period
    path = _follow_key(rig, law.law.at(time))
    joints = path.joints
    per_radian = rig.arm.counts_per_revolution / (2 * np.pi)
    slower = np.abs(joints.velocity).min(axis=1) * per_radian * period
    knots = choose_knots(law.law, slower, period)
    segments = quantise(joints, knots, per_radian)
    cruise, speed, error = _cruise(rig, law, segments)
    turn = rig.arm.counts_per_revolution
    hover = _hover_joints(rig, joints.position[0])
    # Accelerations are largest where phases meet, which may be between two samples.
    peaks = _follow_key(rig, law.law.at(np.union1d(time, law.law.times)))
    return Trajectory(
        law, time, path.rise, path.angle, path.fingertip, joints,
        tilt(path.angle.position, joints.position), path.slide,
        segments, cruise, speed, error, to_counts(rig.arm.home_angles, turn),
        to_counts(hover, turn), _checks(rig, peaks, hover, segments, error),
    )  # fmt: skip


class _Path(NamedTuple):
    """The mechanism at the same times; as in `Trajectory`."""

    rise: Motion
    angle: Motion
    fingertip: Motion
    joints: Motion
    slide: Floats


def _follow_key(rig: Rig, rise: Motion) -> _Path:
    key, arm = rig.key, rig.arm
    angle = key_motion(key, rise)
    if rig.press.hold == "normal":
        joints, slide = joints_holding_normal(arm, key, angle)
        return _Path(rise, angle, fingertip_motion(arm, joints), joints, slide)
    above = key.surface_height + arm.fingertip_radius
    fingertip = point_on_key(angle, -key.press_arm, above)
    joints = joints_holding_point(arm, fingertip)
    return _Path(rise, angle, fingertip, joints, np.zeros_like(angle.position))


def _hover_joints(rig: Rig, start: Floats) -> Floats:
    """Return the joint angles [rad] with the fingertip above the pressing point at rest.

    Args:
        rig: The bench.
        start: rad, joint angles at the start of the press, in whose turn joint 1 hovers.
    """
    above = rig.key.surface_height + rig.arm.fingertip_radius + rig.press.hover
    still = np.zeros((1, 2))
    centre = Motion(np.array([[-rig.key.press_arm, above]]), still, still)
    joints = joints_holding_point(rig.arm, centre, "the point press.hover above the key")
    first, second = joints.position[0]
    return np.array([first + 2 * np.pi * np.round((start[0] - first) / (2 * np.pi)), second])


def _cruise(rig: Rig, law: PressLaw, segments: Segments):
    """Return the cruise of the quantised motion: its window, mean speed and largest error."""
    per_radian = rig.arm.counts_per_revolution / (2 * np.pi)
    period = rig.controller.sample_period
    time, joints = controller_motion(segments, FINE, per_radian, period)
    ends = np.concatenate([[0], np.cumsum(segments.samples)]) * period
    inside = ends[(ends >= law.cruise_start) & (ends <= law.cruise_end)]
    if len(inside) < 2:
        raise TrajectoryError(
            f"press.jack_speed: the cruise of {(law.cruise_end - law.cruise_start) * 1e3:.3g} ms"
            f" holds no whole segment of the controller (samples of {period * 1e3:.3g} ms);"
            " lower jack_speed or raise jack_rise"
        )
    window = (time >= inside[0]) & (time <= inside[-1])
    joints = Motion(*(array[window] for array in joints))
    centre = fingertip_motion(rig.arm, joints)
    angle = key_under_fingertip(rig.key, rig.arm.fingertip_radius, centre)
    jack = jack_motion(rig.key, angle)
    travelled = jack.position[-1] - jack.position[0]
    error = np.abs(jack.velocity / rig.press.jack_speed - 1).max()
    cruise = (float(inside[0]), float(inside[-1]))
    return cruise, float(travelled / (cruise[1] - cruise[0])), float(error)


def _checks(
    rig: Rig, path: _Path, hover: Floats, segments: Segments, error: float
) -> tuple[Check, ...]:
    arm, key, press = rig.arm, rig.key, rig.press
    joints = path.joints
    outside, inside = reach_margins(arm, path.fingertip.position)
    bend = elbow_sign(arm) * joints.position[:, 1]
    depth = -point_on_key(path.angle, -key.press_arm, key.surface_height).position[:, 1]
    from_pin = key.press_arm - path.slide
    move_base = "move arm.base_x or arm.base_z"
    slower = "lower press.jack_speed"
    softer = "lower press.run_up_acceleration or press.run_down_acceleration"
    found = [
        at_least("reach", min(outside.min(), inside.min()), 0.0, "m", move_base),
        at_least(
            "singularity",
            min(bend.min(), (np.pi - bend).min()),
            SINGULARITY_MARGIN,
            "rad",
            f"{move_base}, or change arm.elbow: the elbow must stay bent to its own side",
        ),
        at_least(
            "contact on the key",
            min(from_pin.min(), key.front_arm - from_pin.max()),
            0.0,
            "m",
            f'{move_base}, or set press.hold = "point": the finger slides off the key',
        ),
        at_most(
            "dip",
            depth.max() + key.surface_height,
            key.dip,
            "m",
            "lower press.jack_rise: the key would run into its felt",
        ),
        at_most(
            "cruise speed error",
            error,
            press.speed_tolerance,
            "1",
            "raise arm.counts_per_revolution or press.speed_tolerance",
        ),
        at_most(
            "segments",
            len(segments) + 1,
            rig.controller.segment_limit,
            "1",
            "shorten the press: raise press.jack_speed or press.return_speed",
        ),
    ]
    for j in (0, 1):
        speed, spin = np.abs(joints.velocity[:, j]).max(), np.abs(joints.acceleration[:, j]).max()
        reached = np.append(joints.position[:, j], hover[j])
        low, high = reached.min(), reached.max()
        name = f"joint {j + 1}"
        found += [
            at_least(f"{name} lower limit", low, arm.lower_limits[j], "rad", move_base),
            at_most(f"{name} upper limit", high, arm.upper_limits[j], "rad", move_base),
            at_most(f"{name} speed", speed, arm.speed_limit, "rad/s", slower),
            at_most(f"{name} acceleration", spin, arm.acceleration_limit, "rad/s^2", softer),
        ]
    return tuple(found)
