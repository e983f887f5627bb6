"""The motion of key, fingertip and joints that follows from the jack's rise."""

from typing import NamedTuple

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.trajectory.arm import fingertip_motion, joints_holding_normal, joints_holding_point
from sautereau.trajectory.key import key_motion, point_on_key
from sautereau.trajectory.motion import Floats, Motion


class Path(NamedTuple):
    """Motion of the mechanism on one time base; arrays of the same first length."""

    rise: Motion
    """Of the jack [m]; shape (n,)."""
    angle: Motion
    """Of the key [rad]; shape (n,)."""
    fingertip: Motion
    """Of the fingertip's centre [m]; shape (n, 2)."""
    joints: Motion
    """rad; shape (n, 2)."""
    slide: Floats
    """m, of the contact along the key; shape (n,)."""


def follow_key(rig: Rig, rise: Motion) -> Path:
    """Return the motion for a rise of the jack, with the rig's hold."""
    key, arm = rig.key, rig.arm
    angle = key_motion(key, rise)
    if rig.press.hold == "normal":
        joints, slide = joints_holding_normal(arm, key, angle)
        return Path(rise, angle, fingertip_motion(arm, joints), joints, slide)
    above = key.surface_height + arm.fingertip_radius
    fingertip = point_on_key(angle, -key.press_arm, above)
    joints = joints_holding_point(arm, fingertip)
    return Path(rise, angle, fingertip, joints, np.zeros_like(angle.position))


def follow_down(rig: Rig, contact: Path, height: Motion) -> Motion:
    """Return the joints [rad] of the straight approach from above the key to contact.

    Args:
        rig: The bench.
        contact: The press, which starts at the end of the approach.
        height: Of the fingertip above its position at contact [m]; shape (n,).
    """
    up = np.array([0.0, 1.0])
    start = contact.fingertip.position[0]
    centre = Motion(
        start + height.position[:, None] * up,
        height.velocity[:, None] * up,
        height.acceleration[:, None] * up,
    )
    joints = joints_holding_point(rig.arm, centre, "the approach from press.hover above the key")
    turn = 2 * np.pi
    unwound = joints.position.copy()
    first = contact.joints.position[0, 0]
    unwound[:, 0] += turn * np.round((first - unwound[-1, 0]) / turn)
    return joints._replace(position=unwound)
