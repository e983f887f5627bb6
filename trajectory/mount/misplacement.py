"""Errors of a press by misplacement of the base."""

from dataclasses import dataclass

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.trajectory.arm import fingertip_motion, tilt
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.follow import follow_key
from sautereau.trajectory.key import jack_motion, key_under_fingertip, rise_of_angle
from sautereau.trajectory.motion import Floats, Motion
from sautereau.trajectory.mount.bases import assess_bases, key_angles
from sautereau.trajectory.timing import press_law

DISPLACEMENT = 1e-3
"""m, assumed displacement of the base."""
TURN = np.radians(0.1)
"""rad, assumed rotation of the base about joint 1."""
POINTS = 257
"""Number of key angles over the press."""
DIRECTIONS = 180
"""Number of directions of a displacement that the plan includes."""


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

    Args:
        rig: The bench.

    Returns:
        The largest tilt [rad] or slide [m] over the press, and its increase per metre for 1 mm in
        the worst direction that leaves the key in reach [rad/m, or 1].

    Raises:
        TrajectoryError: The arm does not reach the key, or with the hold `normal` its elbow is on
            the other side.
    """
    arm = rig.arm
    around = np.linspace(0, 2 * np.pi, DIRECTIONS, endpoint=False)
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

    return worse(DISPLACEMENT, 0, 0), worse(0, DISPLACEMENT, 0), worse(0, 0, TURN)


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
