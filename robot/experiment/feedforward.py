"""Feed-forward of the key's force, as measured in an earlier press.

The measured force against depression becomes joint torques, -J^T F with the arm's Jacobian J,
that a later press adds to those of its position loops. From the last release on they are constant.
"""

from pathlib import Path

import numpy as np

from sautereau.analysis.loading.press import Press, load_press
from sautereau.analysis.phases import Phases, find_phases
from sautereau.rig.capabilities import capabilities_of
from sautereau.rig.schema import Rig
from sautereau.robot.controller import TorqueTable
from sautereau.robot.errors import RobotError
from sautereau.trajectory.dynamics import joint_torques
from sautereau.trajectory.expected import Expectation
from sautereau.trajectory.key import surface_axes
from sautereau.trajectory.press import Trajectory
from sautereau.trajectory.timing import press_law

BIN = 25e-6  # m of jack rise, over which the force is averaged


def force_of(recording: Path) -> Expectation:
    """Return the force against depression of a recorded press; see `measured_force`."""
    press = load_press(recording)
    return measured_force(press, find_phases(press))


def measured_force(press: Press, phases: Phases) -> Expectation:
    """Return the force against depression that a press has measured while going down.

    It covers all strings, from the first contact to the last release. Beyond that it is the mean
    force down to the deepest point.

    Raises:
        RobotError: The press has no pluck.
    """
    rise, force = (press.samples[name] for name in ("jack_rise", "force"))
    time = press.time
    if not phases.plucks:
        raise RobotError(
            f"feed-forward from {press.path}: it has no pluck; give the recording of a press with"
            " one"
        )
    contact_time = min(pluck.contact for pluck in phases.plucks)
    release_time = max(pluck.release for pluck in phases.plucks)
    first, bottom = int(np.argmax(rise > BIN)), int(np.argmax(rise))
    release = int(np.searchsorted(time, release_time))
    # 1 ms later the finger's oscillation has decayed.
    after = int(np.searchsorted(time, release_time + 1e-3))
    at_rest = float(force[: first // 2 + 1].mean())  # before the run-up changes it
    contact_rise, release_rise = np.interp([contact_time, release_time], time, rise)
    places = np.floor(rise[first:release] / BIN).astype(int)
    kept = (places >= 0) & (places < int(release_rise / BIN))
    places, pushed = places[kept], force[first:release][kept] - at_rest
    number = np.bincount(places)
    middles = (np.flatnonzero(number) + 0.5) * BIN
    means = np.bincount(places, pushed)[number > 0] / number[number > 0]
    held = float(force[after : max(bottom, after + 1)].mean()) - at_rest
    return Expectation(
        rise=np.concatenate([[0.0], middles, [release_rise, release_rise + BIN]]),
        force=np.concatenate([[0.0], means, [means[-1], held]]),
        contact=float(contact_rise),
        release=float(release_rise),
    )


def torque_table(rig: Rig, trajectory: Trajectory, measured: Expectation) -> TorqueTable:
    """Return the torques that balance a measured force; they are 0 at the start and the end.

    They follow the depression of the press, without a learned correction, down to its deepest
    point, are constant there, and fall in proportion to the rise on the way back, where the key
    returns by itself.

    Args:
        measured: As `measured_force` returns it.

    Raises:
        RobotError: The controller adds no torques, or with them a joint's torque would exceed
            its limit.
    """
    if not capabilities_of(rig).torque_feed_forward:
        raise RobotError(
            f"feed-forward: a controller of kind {rig.controller.kind} adds no torques; press"
            " without, or with another controller"
        )
    # The correction makes the jack follow this rise, not the one that is sent.
    rise = press_law(rig.press).law.at(trajectory.time).position
    force = measured.force_at(rise)
    back = trajectory.time > trajectory.law.return_start
    if rise.max() > 0:
        force = np.where(back, measured.force_at(rise.max()) * rise / rise.max(), force)
    _, normal = surface_axes(trajectory.angle.position)
    bare = joint_torques(rig.arm, trajectory.joints)
    loaded = joint_torques(rig.arm, trajectory.joints, force[:, None] * normal)
    peaks = np.abs(loaded).max(axis=0)
    faults = [
        f"joint {j} would need {peak:.4g} N m, above arm.torque_limit,"
        f" {rig.arm.torque_limit:.4g} N m"
        for j, peak in enumerate(peaks, 1)
        if peak > rig.arm.torque_limit
    ]
    if faults:
        raise RobotError(
            f"feed-forward: {' and '.join(faults)}; give a recording of this key, or press without"
        )
    return TorqueTable(trajectory.time, loaded - bare)
