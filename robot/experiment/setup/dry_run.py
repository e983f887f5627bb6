"""Play the press in the air, well above the key."""

import numpy as np

from sautereau.rig.load import with_values
from sautereau.rig.schema import Rig
from sautereau.robot.errors import MotionFault
from sautereau.robot.experiment.setup.contact import play_measured
from sautereau.robot.experiment.setup.step import Ask, Found, approach_speed, ask_first, homed
from sautereau.trajectory.press import Trajectory, plan_press

TOUCHED = 0.2
"""N, at which the finger has met something in the air."""


def play_in_air(rig: Rig, ask: Ask) -> Found:
    """Play approach, press and retreat so high that the finger stays `press.hover` off the key.

    Raises:
        RobotError: The motion broke off, or the finger met something; the motors are off.
        TrajectoryError: The press cannot be made so high.
    """
    trajectory, lift = raised(rig)
    ask_first(
        ask,
        "dry-run",
        f"The arm homes and plays the press {lift * 1e3:.1f} mm higher than it will be. Is its way"
        " free?",
    )
    with homed(rig) as controller:
        controller.move_to(trajectory.hover, approach_speed(rig))
        errors, forces = [], []
        for segments in (trajectory.approach, trajectory.segments, trajectory.retreat):
            capture, force = play_measured(rig, controller, segments)
            if capture.following_errors is not None:
                errors.append(np.abs(capture.following_errors).max())
            if force is not None:
                forces.append(float(np.abs(force).max()))
        if forces and max(forces) > TOUCHED:
            raise MotionFault(
                f"setup dry-run: the finger felt {max(forces):.3g} N in the air, and more than"
                f" {TOUCHED:g} N is a touch; see what is in its way, or whether the force channel's"
                " cable moves with the arm"
            )
    lines = [f"dry-run: the press was played {lift * 1e3:.1f} mm higher, to its end"]
    figures = {"lift": lift}
    if errors:
        counts = float(max(errors))
        limit = rig.controller.position_error_limit
        lines.append(f"the joints were {counts:.0f} counts behind at most, of {limit} allowed")
        figures["following_error"] = counts * rig.arm.radians_per_count
    if forces:
        lines.append(f"the force channel showed {max(forces) * 1e3:.0f} mN at most")
        figures["force"] = max(forces)
    return Found(tuple(lines), figures=figures)


def raised(rig: Rig) -> tuple[Trajectory, float]:
    """Return the press as it is played in the air, and how much higher [m] that is.

    It is planned for a base that stands so much lower: the joints then do the same, and the
    real finger is higher.
    """
    heights = plan_press(rig).fingertip.position[:, 1]
    lift = float(heights[0] - heights.min()) + rig.press.hover
    lower = with_values(rig, {"arm.base_z": f"{rig.arm.base_z - lift!r} m"})
    return plan_press(lower), lift
