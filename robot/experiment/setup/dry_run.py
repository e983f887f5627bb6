"""Play the press in the air, well above the key."""

import numpy as np

from sautereau.rig.load import with_values
from sautereau.rig.schema import Rig
from sautereau.robot.errors import MotionFault
from sautereau.robot.experiment.setup.contact import play_measured
from sautereau.robot.experiment.setup.step import Ask, Found, approach_speed, ask_first, homed
from sautereau.trajectory.press import Trajectory, plan_press

TOUCHED = 0.2  # N, above which the finger has touched something in the air


def play_in_air(rig: Rig, ask: Ask) -> Found:
    """Play approach, press and retreat so high that the finger stays `press.hover` off the key.

    Raises:
        RobotError: The motion broke off, or the finger touched something in it; then the motors
            are off, and the motions after it are not played.
        TrajectoryError: The press cannot be planned at that height.
    """
    trajectory, lift = raised(rig)
    ask_first(
        ask,
        "dry-run",
        f"The arm homes and plays the press, {lift * 1e3:.1f} mm above its real height. Is"
        " the space free?",
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
            if forces and forces[-1] > TOUCHED:
                raise MotionFault(
                    f"setup dry-run: the force reached {forces[-1]:.3g} N in the air, above"
                    f" {TOUCHED:g} N; check what is in the way, and whether the force channel's"
                    " cable moves with the arm"
                )
    lines = [f"dry-run: the complete press was played {lift * 1e3:.1f} mm above its height"]
    figures = {"lift": lift}
    if errors:
        counts = float(max(errors))
        limit = rig.controller.position_error_limit
        lines.append(f"largest following error: {counts:.0f} counts, limit {limit}")
        figures["following_error"] = counts * rig.arm.radians_per_count
    if forces:
        lines.append(f"largest force: {max(forces) * 1e3:.0f} mN")
        figures["force"] = max(forces)
    return Found(tuple(lines), figures=figures)


def raised(rig: Rig) -> tuple[Trajectory, float]:
    """Return the press as it is played in the air, and by how much it is raised [m].

    It is planned for a base that is lower by that much, so that the real finger moves higher by
    it.
    """
    heights = plan_press(rig).fingertip.position[:, 1]
    lift = float(heights[0] - heights.min()) + rig.press.hover
    lower = with_values(rig, {"arm.base_z": f"{rig.arm.base_z - lift!r} m"})
    return plan_press(lower), lift
