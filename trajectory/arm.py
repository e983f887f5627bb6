"""The two-link finger: joint motion from the fingertip's or the key's, and back, in closed form.

Joint angle 1 is measured from the x axis, joint angle 2 from link 1. The two holds are the two
ways in which two joints can follow the key: `point` keeps the contact point on the key, `normal`
keeps link 2 along the key's normal.
"""

from dataclasses import dataclass

import numpy as np

from sautereau.rig.instrument import Key
from sautereau.rig.schema import Arm, Rig
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.key import (
    jack_motion,
    key_motion,
    key_under_fingertip,
    point_on_key,
    surface_axes,
)
from sautereau.trajectory.motion import Floats, Motion, cross


def base(arm: Arm) -> Floats:
    """Return the position [m] of joint 1, shape (2,)."""
    return np.array([arm.base_x, arm.base_z])


def elbow_sign(arm: Arm) -> int:
    """Return the sign of joint angle 2 on the arm's elbow branch."""
    return -1 if arm.elbow == "up" else 1


def reach_margins(arm: Arm, centre: Floats) -> tuple[Floats, Floats]:
    """Return the distances [m] of points from the outer and the inner edge of the reach.

    Args:
        centre: m, centre of the fingertip, shape (n, 2).
    """
    distance = np.hypot(*(centre - base(arm)).T)
    outer = arm.upper_length + arm.lower_length
    return outer - distance, distance - abs(arm.upper_length - arm.lower_length)


def fingertip_place(arm: Arm, joints: Floats) -> Floats:
    """Return the position [m] of the fingertip's centre at joint angles [rad]; (..., 2)."""
    first = joints[..., 0]
    total = first + joints[..., 1]
    x = arm.upper_length * np.cos(first) + arm.lower_length * np.cos(total)
    z = arm.upper_length * np.sin(first) + arm.lower_length * np.sin(total)
    return np.stack([arm.base_x + x, arm.base_z + z], -1)


def fingertip_motion(arm: Arm, joints: Motion) -> Motion:
    """Return the motion [m] of the fingertip's centre from the joints' [rad]; (n, 2)."""
    first = joints.position[..., 0]
    total = first + joints.position[..., 1]
    upper, upper_turned = link_vectors(arm.upper_length, first)
    lower, lower_turned = link_vectors(arm.lower_length, total)
    speed1, speed2 = joints.velocity[..., :1], joints.velocity.sum(-1, keepdims=True)
    alpha1, alpha2 = joints.acceleration[..., :1], joints.acceleration.sum(-1, keepdims=True)
    return Motion(
        base(arm) + upper + lower,
        speed1 * upper_turned + speed2 * lower_turned,
        alpha1 * upper_turned - speed1**2 * upper + alpha2 * lower_turned - speed2**2 * lower,
    )


def joints_holding_point(arm: Arm, centre: Motion, what: str = "the fingertip's path") -> Motion:
    """Return the joints [rad] that move the fingertip's centre along a path, arrays (n, 2).

    Args:
        what: The path's name in errors.

    Raises:
        TrajectoryError: The path leaves the reach, or touches its edge, where the joints' speeds
            are unbounded.
    """
    outside, inside = reach_margins(arm, centre.position)
    if min(outside.min(), inside.min()) <= 0:
        short = min(outside.min(), inside.min())
        side = "beyond the outer" if outside.min() < inside.min() else "inside the inner"
        raise TrajectoryError(
            f"reach: {what} lies {-short * 1e3:.4g} mm {side} reach of the arm"
            f" (links {arm.upper_length * 1e3:.4g} and {arm.lower_length * 1e3:.4g} mm, base at"
            f" x = {arm.base_x * 1e3:.4g}, z = {arm.base_z * 1e3:.4g} mm);"
            " move arm.base_x and arm.base_z, or change key.press_arm"
        )
    l1, l2 = arm.upper_length, arm.lower_length
    offset = centre.position - base(arm)
    distance = np.hypot(offset[..., 0], offset[..., 1])
    cosine = (distance**2 - l1**2 - l2**2) / (2 * l1 * l2)
    # Heron's product is accurate for an arm that is nearly straight or folded.
    product = outside * (l1 + l2 + distance) * inside * (distance + abs(l1 - l2))
    sine = elbow_sign(arm) * np.sqrt(product) / (2 * l1 * l2)
    second = np.arctan2(sine, cosine)
    first = np.arctan2(offset[..., 1], offset[..., 0]) - np.arctan2(l2 * sine, l1 + l2 * cosine)
    _, turned1 = link_vectors(l1, first)
    lower, turned2 = link_vectors(l2, first + second)
    upper = offset - lower
    determinant = l1 * l2 * sine
    # J = [turned1 + turned2, turned2] maps joint speeds to the fingertip's velocity.
    velocity = _solve(turned1 + turned2, turned2, determinant, centre.velocity)
    total = velocity.sum(-1, keepdims=True)
    centripetal = velocity[..., :1] ** 2 * upper + total**2 * lower
    acceleration = _solve(
        turned1 + turned2, turned2, determinant, centre.acceleration + centripetal
    )
    return Motion(np.stack([_unwound(arm, first), second], -1), velocity, acceleration)


def joints_holding_normal(arm: Arm, key: Key, angle: Motion) -> tuple[Motion, Floats]:
    """Return the joints [rad] that keep link 2 along the key's normal, and the tip's slide.

    The elbow stays at the height H = surface + radius + link 2 over the key's pin line,
    at a distance s along it with |elbow - base| = link 1.

    Returns:
        The joints, arrays (n, 2), and the slide [m] of the contact along the key from the
        nominal pressing point, shape (n,).

    Raises:
        TrajectoryError: Link 1 is too short or too long for this hold.
    """
    height = key.surface_height + arm.fingertip_radius + arm.lower_length
    tangent, normal = surface_axes(angle.position)
    base_along, base_above = tangent @ base(arm), normal @ base(arm)
    rest = arm.upper_length**2 - (height - base_above) ** 2
    if rest.min() <= 0:
        raise TrajectoryError(
            f'reach: with hold = "normal" the elbow is {abs(height - base_above).max() * 1e3:.4g}'
            f" mm from the base, more than link 1 of {arm.upper_length * 1e3:.4g} mm;"
            " move arm.base_z towards the elbow's height"
        )
    side = 1.0 if np.mean(-key.press_arm - base_along) >= 0 else -1.0
    across = side * np.sqrt(rest)
    along = base_along + across
    elbow = _elbow_motion(angle, along, across, height, base_above, tangent, normal)
    offset = elbow.position - base(arm)
    squared = arm.upper_length**2
    first = _unwound(arm, np.arctan2(offset[..., 1], offset[..., 0]))
    speed = cross(offset, elbow.velocity) / squared
    acceleration = cross(offset, elbow.acceleration) / squared
    second = angle.position - np.pi / 2 - first
    second = second - 2 * np.pi * np.round(second.mean() / (2 * np.pi))
    joints = Motion(
        np.stack([first, second], -1),
        np.stack([speed, angle.velocity - speed], -1),
        np.stack([acceleration, angle.acceleration - acceleration], -1),
    )
    return joints, along + key.press_arm


def _elbow_motion(angle, along, across, height, base_above, tangent, normal) -> Motion:
    """Differentiate |elbow - base|^2 = link 1^2 twice along the key's motion."""
    omega, alpha = angle.velocity, angle.acceleration
    above = height - base_above
    slide = height * omega - along * omega * above / across
    velocity_t, velocity_n = slide - height * omega, along * omega
    known_n = 2 * slide * omega - height * omega**2 + along * alpha
    squares = velocity_t**2 + velocity_n**2 + above * known_n
    slide_rate = height * alpha + along * omega**2 - squares / across
    acceleration_t = slide_rate - height * alpha - along * omega**2

    def vector(t, n):
        return t[..., None] * tangent + n[..., None] * normal

    return Motion(
        vector(along, np.full_like(along, height)),
        vector(velocity_t, velocity_n),
        vector(acceleration_t, known_n),
    )


def tilt(angle: Floats, joints: Floats) -> Floats:
    """Return the angle [rad] from the key's inward normal to link 2, shape (n,)."""
    return nearest_turn(joints[..., 0] + joints[..., 1] - (angle - np.pi / 2), 0.0)


def nearest_turn(angle: Floats, reference: Floats | float) -> Floats:
    """Return angles [rad] plus the integer number of turns nearest to a reference."""
    return angle - 2 * np.pi * np.round((angle - reference) / (2 * np.pi))


def _unwound(arm: Arm, first: Floats) -> Floats:
    """Return joint 1 [rad] without jumps, starting in the turn of its limits."""
    path = np.unwrap(first)
    middle = (arm.lower_limits[0] + arm.upper_limits[0]) / 2
    return path + nearest_turn(path[0], middle) - path[0]


def link_vectors(length: float, angle: Floats) -> tuple[Floats, Floats]:
    """Return a link's vector and its derivative by the angle, each (n, 2)."""
    cosine, sine = length * np.cos(angle), length * np.sin(angle)
    return np.stack([cosine, sine], -1), np.stack([-sine, cosine], -1)


def _solve(column1: Floats, column2: Floats, determinant: Floats, right: Floats) -> Floats:
    """Solve the 2 by 2 systems [column1, column2] x = right by Cramer's rule."""
    return np.stack([cross(right, column2) / determinant, cross(column1, right) / determinant], -1)


@dataclass(frozen=True)
class Path:
    """Motion of the mechanism on one time base; arrays of the same first length."""

    rise: Motion
    """Motion of the jack [m]; shape (n,)."""
    angle: Motion
    """Motion of the key [rad]; shape (n,)."""
    fingertip: Motion
    """Motion of the fingertip's centre [m]; shape (n, 2)."""
    joints: Motion
    """Motion of the joints [rad]; shape (n, 2)."""
    slide: Floats
    """m, of the contact along the key; shape (n,)."""


def jack_under_finger(rig: Rig, joints: Motion) -> Motion:
    """Return the jack's motion [m] with the fingertip on the key, from that of the joints [rad]."""
    centre = fingertip_motion(rig.arm, joints)
    return jack_motion(rig.key, key_under_fingertip(rig.key, rig.arm.fingertip_radius, centre))


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
        contact: The press, which starts at the end of the approach.
        height: Height of the fingertip above its position at contact [m]; shape (n,).
    """
    up = np.array([0.0, 1.0])
    start = contact.fingertip.position[0]
    centre = Motion(
        start + height.position[:, None] * up,
        height.velocity[:, None] * up,
        height.acceleration[:, None] * up,
    )
    joints = joints_holding_point(rig.arm, centre, "the approach from press.hover above the key")
    unwound = joints.position.copy()
    last = unwound[-1, 0]
    unwound[:, 0] += nearest_turn(last, contact.joints.position[0, 0]) - last
    return joints._replace(position=unwound)
