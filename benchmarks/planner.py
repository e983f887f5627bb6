"""The planner: one press planned, and its parts beside roboticstoolbox and ruckig."""

import importlib
import math
import time
from collections.abc import Callable
from types import ModuleType

import numpy as np

from benchmarks.figures import Figure, check, median_time
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig
from sautereau.trajectory.arm import base, fingertip_motion, joints_holding_point
from sautereau.trajectory.motion import Floats, Motion
from sautereau.trajectory.press import plan_press
from sautereau.trajectory.timing import press_law

CRUISE_LIMIT = 0.1  # %, speed error of the jack in the cruise
REACH_LIMIT = 1e-9  # m, error of a fingertip's position, ours or a peer's
SAME = 1e-12  # m/s, m and s, tolerance within which two time-optimal run-ups are equal


def run() -> list[Figure]:
    """Return time and error of a plan, of its inverse kinematics and of its run-up."""
    rig = load_rig()
    return [*_plan(rig), *_inverse_kinematics(rig), *_run_up(rig)]


def _plan(rig: Rig) -> list[Figure]:
    plan = plan_press(rig)
    error = plan.cruise.error * 100
    failed = [each.name for each in plan.checks if not each.holds]
    check(not failed, f"checks of the plan fail: {failed}")
    spent = median_time(lambda: plan_press(rig)) * 1e3
    return [
        Figure("a press planned, quantised and checked", spent, "ms", "limit", 5.0),
        Figure("speed error in its cruise", error, "%", "limit", CRUISE_LIMIT),
    ]


def _inverse_kinematics(rig: Rig) -> list[Figure]:
    """Solve the complete path; ours returns speeds and accelerations of the joints, too."""
    path = plan_press(rig).fingertip
    ours = joints_holding_point(rig.arm, path).position
    error = _fingertip_error(rig, ours, path.position)
    check(error < REACH_LIMIT, f"our fingertip is {error:.3g} m off its path")
    spent = median_time(lambda: joints_holding_point(rig.arm, path))
    their_error = their_spent = math.nan
    toolbox, name = _peer("roboticstoolbox")
    if toolbox:
        theirs, their_spent = _toolbox_joints(toolbox, rig, path.position, ours[0])
        their_error = _fingertip_error(rig, theirs, path.position)
        check(
            their_error < REACH_LIMIT, f"{name}: its fingertip is {their_error:.3g} m off its path"
        )
        off = float(np.abs(theirs - ours).max())
        check(off < 1e-7, f"{name}: its joints differ by {off:.3g} rad")
        name = f"{name} ik_GN"
    what = f"joints of {len(ours)} poses"
    return [
        Figure(f"{what}: time", spent * 1e3, "ms", name, their_spent * 1e3),
        Figure(f"{what}: largest error of the fingertip", error, "m", name, their_error),
    ]


def _toolbox_joints(
    toolbox: ModuleType, rig: Rig, centre: Floats, start: Floats
) -> tuple[Floats, float]:
    """Return a peer's joints [rad], (n, 2), and its time [s], each pose started from the last one.

    Its plane is x and y; Gauss-Newton is the fastest of its numeric solvers here.
    """
    arm = rig.arm
    lengths = (arm.upper_length, arm.lower_length)
    robot = toolbox.DHRobot([toolbox.RevoluteDH(a=length) for length in lengths])
    poses = np.tile(np.eye(4), (len(centre), 1, 1))
    poses[:, :2, 3] = centre - base(arm)
    joints = [start]
    clock = time.perf_counter()
    for pose in poses:
        found = robot.ik_GN(pose, q0=joints[-1], mask=[1, 1, 0, 0, 0, 0], tol=1e-20)
        check(found.success, f"{robot.name} found no joints at {pose[:2, 3]} m")
        joints.append(found.q)
    return np.array(joints[1:]), time.perf_counter() - clock


def _fingertip_error(rig: Rig, joints: Floats, centre: Floats) -> float:
    """Return the largest distance [m] of fingertips, by forward kinematics, from a path."""
    still = np.zeros_like(joints)
    reached = fingertip_motion(rig.arm, Motion(joints, still, still)).position
    return float(np.hypot(*(reached - centre).T).max())


def _run_up(rig: Rig) -> list[Figure]:
    """Compare with the time-optimal change of speed under the same limits."""
    press = rig.press
    law = press_law(press)
    spent = median_time(lambda: press_law(press)) * 1e6
    duration = law.cruise_start - law.start
    their_duration = their_spent = speed = place = math.nan
    ruckig, name = _peer("ruckig")
    if ruckig:
        solve = _ruckig_run_up(ruckig, rig)
        theirs = solve()
        their_spent, their_duration = median_time(solve) * 1e6, theirs.duration
        instants = np.linspace(0, duration, 101)
        ours = law.law.at(law.start + instants)
        states = np.array([theirs.at_time(t) for t in instants])[:, :, 0]
        place = float(np.abs(ours.position - states[:, 0]).max())
        speed = float(np.abs(ours.velocity - states[:, 1]).max())
        off = max(place, speed, abs(duration - their_duration))
        check(off < SAME, f"{name}: the run-up differs by {off:.3g} m, m/s or s")
    return [
        Figure("run-up to the cruise", duration * 1e3, "ms", name, their_duration * 1e3),
        Figure(f"its speed, largest difference from {name}", speed, "m/s", "limit", SAME),
        Figure(f"its place, largest difference from {name}", place, "m", "limit", SAME),
        Figure("law of the complete press: time", spent, "us", f"{name}, run-up", their_spent),
    ]


def _ruckig_run_up(ruckig: ModuleType, rig: Rig) -> Callable:
    press = rig.press
    solver, target = ruckig.Ruckig(1), ruckig.InputParameter(1)
    target.control_interface = ruckig.ControlInterface.Velocity
    target.current_position = target.current_velocity = target.current_acceleration = [0.0]
    target.target_velocity, target.target_acceleration = [press.jack_speed], [0.0]
    target.max_acceleration, target.max_jerk = [press.run_up_acceleration], [press.run_up_jerk]

    def solve():
        trajectory = ruckig.Trajectory(1)
        check(
            solver.calculate(target, trajectory) == ruckig.Result.Working, "ruckig finds no run-up"
        )
        return trajectory

    return solve


def _peer(name: str) -> tuple[ModuleType | None, str]:
    """Return a peer, None if not installed, and its name for the rows."""
    try:
        return importlib.import_module(name), name
    except ImportError:
        return None, f"{name} (not installed)"
