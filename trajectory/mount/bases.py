"""Assessment of bases: the residual of the hold, the margin of each limit, and misplacement.

For a base out of reach the arm is taken as stretched or folded towards the key, so that all
margins stay finite and measure the violation of each limit.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sautereau.rig.schema import Arm, Rig
from sautereau.trajectory.arm import fingertip_motion, follow_key, nearest_turn, tilt
from sautereau.trajectory.checks import SINGULARITY_MARGIN
from sautereau.trajectory.dynamics import gravity_torque, tip_torque
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.key import (
    angle_of_rise,
    jack_motion,
    key_under_fingertip,
    rise_of_angle,
    surface_axes,
)
from sautereau.trajectory.motion import Floats, Motion, dot
from sautereau.trajectory.timing import press_law

ELBOWS = ("up", "down")
LIMITS = {
    "reach": "widen arm.mount_x and arm.mount_z towards the key, or lengthen the links",
    "singularity": "the elbow would be straight, folded or on its other side: widen arm.mount_x"
    " and arm.mount_z, or change the links' lengths",
    "contact on the key": 'widen arm.mount_x, or set press.hold = "point"',
    "joint 1 limits": "widen arm.lower_limits and arm.upper_limits",
    "joint 2 limits": "widen arm.lower_limits and arm.upper_limits",
    "elbow clearance": "the elbow would come below key.neighbour_height: raise arm.mount_z",
    "torque": "raise arm.torque_limit, or lighten the links",
}
"""The limits that may exclude a base, each with how to fix it."""

FINGER_FORCE = 1.5
"""N, expected along the key's inward normal: about three times that of a pluck at 0.07 m/s."""
DISPLACEMENT = 1e-3  # m, assumed displacement of the base
POINTS = 257  # Number of key angles over the press


class BaseAssessment(NamedTuple):
    """Residuals and margins of n bases with one elbow branch."""

    residual: Floats
    """Residual of the hold, tilt [rad] or slide [m], at each angle; shape (n, k)."""
    margins: Floats
    """Dimensionless, smallest margin of each of `LIMITS` relative to a scale; shape (7, n)."""

    @property
    def worst_residual(self) -> Floats:
        """Largest magnitude of the residual, shape (n,)."""
        return np.abs(self.residual).max(-1)

    @property
    def violation(self) -> Floats:
        """Dimensionless, violation of the worst limit; not positive if all hold; shape (n,)."""
        return -self.margins.min(0)

    @property
    def cost(self) -> Floats:
        """The worst residual if all limits hold, and far more otherwise; shape (n,)."""
        return np.where(self.violation > 0, 1e6 + self.violation, self.worst_residual)


def key_angles(rig: Rig, n: int) -> Floats:
    """Return n key angles [rad] from rest to the rig's full rise, closely spaced at the ends."""
    rises = (rig.press.jack_rise,) if rig.press.gesture is None else rig.press.gesture.rise
    low, high = min(0.0, *rises), max(rises)
    rises = low + (high - low) * (1 - np.cos(np.linspace(0, np.pi, n))) / 2
    return angle_of_rise(rig.key, rises)


def assess_bases(rig: Rig, elbow: str, bases: Floats, angles: Floats) -> BaseAssessment:
    """Return residual and margins of bases.

    Args:
        rig: The bench; its own base and elbow are ignored.
        elbow: `up` or `down`.
        bases: m, positions of joint 1, shape (n, 2).
        angles: rad, of the key, shape (k,).
    """
    arm, key = rig.arm, rig.key
    sign = -1.0 if elbow == "up" else 1.0
    height = key.surface_height + arm.fingertip_radius
    tangent, normal = surface_axes(angles)
    if rig.press.hold == "normal":
        first, second, reach, residual = _normal(rig, bases, angles)
        slide = residual
    else:
        centre = height * normal - key.press_arm * tangent
        first, second, reach = _point(arm, sign, bases, centre)
        residual = nearest_turn(first + second - (angles - np.pi / 2), 0.0)
        slide = np.zeros_like(residual)
    above = np.array([[-key.press_arm, height + rig.press.hover]])
    hover1, hover2, hover_reach = _point(arm, sign, bases, above)
    middle = (arm.lower_limits[0] + arm.upper_limits[0]) / 2
    start = nearest_turn(first[:, :1], middle)
    first, hover1 = nearest_turn(first, start), nearest_turn(hover1, start)
    scale = arm.upper_length + arm.lower_length
    bend = sign * second
    from_pin = key.press_arm - slide
    margins = [
        np.minimum(reach, hover_reach) / scale,
        (np.minimum(bend, np.pi - bend) - SINGULARITY_MARGIN).min(-1) / np.pi,
        np.minimum(from_pin, key.front_arm - from_pin).min(-1) / scale,
    ]
    for j, path in enumerate((np.hstack([first, hover1]), np.hstack([second, hover2]))):
        low, high = path.min(-1), path.max(-1)
        margins.append(np.minimum(low - arm.lower_limits[j], arm.upper_limits[j] - high) / np.pi)
    lowest = np.sin(np.hstack([first, hover1])).min(-1) * arm.upper_length + bases[:, 1]
    margins.append((lowest - key.neighbour_height) / scale)
    joints = np.stack([first, second], -1)  # with and without a force on the key
    weight = gravity_torque(arm, joints)
    carried = weight - tip_torque(arm, joints, FINGER_FORCE * normal)
    torque = np.maximum(np.abs(weight), np.abs(carried)).max((-2, -1))
    margins.append(1 - torque / arm.torque_limit)
    return BaseAssessment(residual, np.array(margins))


def _point(arm: Arm, sign: float, bases: Floats, centre: Floats) -> tuple[Floats, Floats, Floats]:
    """Return both joints [rad], (n, k), and the margin of the reach [m], (n,); see `arm.py`."""
    l1, l2 = arm.upper_length, arm.lower_length
    offset = centre - bases[:, None]
    squared = dot(offset, offset)
    distance = np.sqrt(squared)
    reach = np.minimum(l1 + l2 - distance, distance - abs(l1 - l2)).min(-1)
    cosine = np.clip((squared - l1**2 - l2**2) / (2 * l1 * l2), -1, 1)
    sine = sign * np.sqrt(1 - cosine**2)
    towards = np.arctan2(offset[..., 1], offset[..., 0])
    first = towards - np.arctan2(l2 * sine, l1 + l2 * cosine)
    return first, np.arctan2(sine, cosine), reach


def _normal(rig: Rig, bases: Floats, angles: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Return both joints [rad], the margin of the reach [m] and the slide [m]; see `arm.py`."""
    arm, key = rig.arm, rig.key
    tangent, normal = surface_axes(angles)
    height = key.surface_height + arm.fingertip_radius + arm.lower_length
    base_along, above = bases @ tangent.T, height - bases @ normal.T
    side = np.where(np.mean(-key.press_arm - base_along, -1, keepdims=True) >= 0, 1.0, -1.0)
    across = side * np.sqrt(np.maximum(arm.upper_length**2 - above**2, 0))
    first = np.arctan2(above, across) + angles
    second = angles - np.pi / 2 - first
    second = second - 2 * np.pi * np.round(second.mean(-1, keepdims=True) / (2 * np.pi))
    reach = (arm.upper_length - np.abs(above)).min(-1)
    return first, second, reach, base_along + across + key.press_arm


@dataclass(frozen=True)
class Misplacement:
    """Errors of a press that is planned for another position of the base.

    The fingertip is assumed to stay in contact with the key.
    """

    height_error: float
    """m, largest error of the jack's height over the press."""
    speed_error: float
    """Dimensionless, largest relative error of the jack's speed in the cruise."""
    tilt_change: float
    """rad, largest change of the finger's tilt over the press."""


def residual_and_sensitivity(rig: Rig) -> tuple[float, float]:
    """Return the residual of the rig's base, and its sensitivity to a known displacement.

    Returns:
        The largest tilt [rad] or slide [m] over the press, and its increase per metre for 1 mm in
        the worst direction that leaves the key in reach [rad/m, or 1].

    Raises:
        TrajectoryError: The arm does not reach the key, or with the hold `normal` its elbow is on
            the other side.
    """
    arm = rig.arm
    around = np.linspace(0, 2 * np.pi, 180, endpoint=False)
    ring = np.stack([np.cos(around), np.sin(around)], -1) * DISPLACEMENT
    bases = np.array([arm.base_x, arm.base_z]) + np.vstack([np.zeros((1, 2)), ring])
    found = assess_bases(rig, arm.elbow, bases, key_angles(rig, POINTS))
    reached = found.margins[0] > 0
    if not reached[0]:
        raise TrajectoryError(
            f"arm.base_x, arm.base_z: from {arm.base_x * 1e3:.4g}, {arm.base_z * 1e3:.4g} mm the"
            " arm does not reach the key over the complete press; use the base that `mount` finds"
        )
    worst = found.worst_residual
    return float(worst[0]), float((worst[reached].max() - worst[0]) / DISPLACEMENT)


def unnoticed(rig: Rig) -> tuple[Misplacement, Misplacement, Misplacement]:
    """Return the errors by 1 mm along x, 1 mm along z and 0.1 deg about joint 1, not in the plan.

    The joints move as planned for the rig's base, the base is elsewhere, and the key follows the
    fingertip. The worse of both directions of each displacement is returned.

    Raises:
        TrajectoryError: No such press exists.
    """
    arm, key = rig.arm, rig.key
    angles = key_angles(rig, POINTS)
    rise = rise_of_angle(key, angles)
    speed = rig.press.jack_speed
    planned = follow_key(rig, Motion(rise, np.full_like(rise, speed), np.zeros_like(rise)))
    angle, joints = planned.angle.position, planned.joints
    cruise = _cruise(rig, rise)

    def errors(x: float, z: float, turn: float) -> tuple[float, float, float]:
        moved = arm.model_copy(update={"base_x": arm.base_x + x, "base_z": arm.base_z + z})
        turned = joints._replace(position=joints.position + np.array([turn, 0.0]))
        centre = fingertip_motion(moved, turned)
        pressed = key_under_fingertip(key, arm.fingertip_radius, centre)
        jack = jack_motion(key, pressed)
        tilt_change = tilt(pressed.position, turned.position) - tilt(angle, joints.position)
        return (
            float(np.abs(jack.position - rise).max()),
            float(np.abs(jack.velocity / speed - 1)[cruise].max()),
            float(np.abs(tilt_change).max()),
        )

    def worse(x: float, z: float, turn: float) -> Misplacement:
        return Misplacement(*map(max, errors(x, z, turn), errors(-x, -z, -turn)))

    return worse(DISPLACEMENT, 0, 0), worse(0, DISPLACEMENT, 0), worse(0, 0, np.radians(0.1))


def _cruise(rig: Rig, rise: Floats) -> np.ndarray:
    """Return whether rises [m] are within the cruise; of a gesture, all are."""
    if rig.press.gesture is not None:
        return np.ones_like(rise, dtype=bool)
    law = press_law(rig.press)
    low, high = law.law.at(np.array([law.cruise_start, law.cruise_end])).position
    inside = (rise >= low) & (rise <= high)
    # A cruise shorter than the grid's step is represented by the point closest to its middle.
    inside[np.abs(rise - (low + high) / 2).argmin()] = True
    return inside
