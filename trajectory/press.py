"""Plan one press: from the jack's law to checked, quantised joint motion."""

from dataclasses import dataclass

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
from trajectory.errors import TrajectoryError
from trajectory.key import jack_motion, key_motion, key_under_fingertip, point_on_key
from trajectory.motion import Floats, Motion
from trajectory.quantise import GRAIN, choose_knots, controller_motion, quantise
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
    grains = int(np.ceil(law.law.duration / period / GRAIN))
    time = np.arange(grains * GRAIN + 1) * period
    rise = law.law.at(time)
    angle = key_motion(rig.key, rise)
    fingertip, joints, slide = _follow_key(rig, angle)
    per_radian = rig.arm.counts_per_revolution / (2 * np.pi)
    slower = np.abs(joints.velocity).min(axis=1) * per_radian * period
    knots = choose_knots(law.law, slower, period)
    segments = quantise(joints, knots, per_radian, period)
    cruise, speed, error = _cruise(rig, law, segments)
    hover = np.rint(_hover_joints(rig) * per_radian).astype(np.int64)
    tilts = tilt(angle.position, joints.position)
    checks = _checks(rig, angle, fingertip, joints, segments, error)
    return Trajectory(
        law, time, rise, angle, fingertip, joints, tilts, slide,
        segments, cruise, speed, error, hover, checks,
    )  # fmt: skip


def _follow_key(rig: Rig, angle: Motion) -> tuple[Motion, Motion, Floats]:
    key, arm = rig.key, rig.arm
    if rig.press.hold == "normal":
        joints, slide = joints_holding_normal(arm, key, angle)
        return fingertip_motion(arm, joints), joints, slide
    above = key.surface_height + arm.fingertip_radius
    fingertip = point_on_key(angle, -key.press_arm, above)
    return fingertip, joints_holding_point(arm, fingertip), np.zeros_like(angle.position)


def _hover_joints(rig: Rig) -> Floats:
    """Return the joint angles [rad] with the fingertip above the pressing point at rest."""
    above = rig.key.surface_height + rig.arm.fingertip_radius + rig.press.hover
    still = np.zeros((1, 2))
    centre = Motion(np.array([[-rig.key.press_arm, above]]), still, still)
    return joints_holding_point(rig.arm, centre).position[0]


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


def _checks(rig, angle, fingertip, joints, segments, error) -> tuple[Check, ...]:
    arm, key, press = rig.arm, rig.key, rig.press
    outside, inside = reach_margins(arm, fingertip.position)
    bend = elbow_sign(arm) * joints.position[:, 1]
    depth = -point_on_key(angle, -key.press_arm, key.surface_height).position[:, 1]
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
        low, high = joints.position[:, j].min(), joints.position[:, j].max()
        name = f"joint {j + 1}"
        found += [
            at_least(f"{name} lower limit", low, arm.lower_limits[j], "rad", move_base),
            at_most(f"{name} upper limit", high, arm.upper_limits[j], "rad", move_base),
            at_most(f"{name} speed", speed, arm.speed_limit, "rad/s", slower),
            at_most(f"{name} acceleration", spin, arm.acceleration_limit, "rad/s^2", softer),
        ]
    return tuple(found)
