"""Plan one press: from the jack's law to checked, quantised joint motion."""

from dataclasses import dataclass

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.trajectory.arm import Path, follow_down, follow_key, jack_under_finger, tilt
from sautereau.trajectory.checks import Check, verify
from sautereau.trajectory.dynamics import joint_torques, mass_matrix, tip_torque
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.expected import Expectation
from sautereau.trajectory.key import carried_force, jack_law, moving_inertia, surface_axes
from sautereau.trajectory.learning import Correction
from sautereau.trajectory.motion import Floats, Motion
from sautereau.trajectory.quantise import quantise, sample_times
from sautereau.trajectory.segments import (
    Counts,
    Segments,
    motion_at,
    segment_cubics,
    to_counts,
)
from sautereau.trajectory.timing import PressLaw, approach_law, press_law

FINE = np.linspace(0.0, 1.0, 65)
"""Points in each segment of the cruise at which its speed is evaluated."""
PROBE = 1e-6  # m, rise over which the slope of the expected force is taken


@dataclass(frozen=True)
class Cruise:
    """The cruise as executed by the controller; of a gesture, the complete gesture."""

    start: float
    """s."""
    end: float
    """s."""
    rise: tuple[float, float]
    """m, of the jack at its start and end."""
    speed: float
    """m/s, mean."""
    error: float
    """Dimensionless, largest error of the speed, relative to the largest planned speed."""
    rms_error: float
    """Dimensionless, RMS error of the speed, relative to the largest planned speed."""


@dataclass(frozen=True)
class Trajectory(Path):
    """One press on one time base, every array of the same first length."""

    law: PressLaw
    time: Floats
    """s from the start of motion, at every controller sample; shape (n,)."""
    torques: Floats
    """N m, required for weight and inertia, and for the expected force with the inertia of key and
    jacks; shape (n, 2)."""
    tilt: Floats
    """rad, of link 2 against the key's normal; shape (n,)."""
    segments: Segments
    """Segments of the press, which starts and ends on the key."""
    approach: Segments
    """Segments before the first press, from `hover` down to contact."""
    retreat: Segments
    """Segments after the last press, back up to `hover`."""
    cruise: Cruise
    loaded_speed_error: float | None
    """Dimensionless, expected RMS error of the jack's speed while a string is held, relative to the
    planned speed; None without a string or `arm.servo_stiffness`."""
    home: Counts
    """Counts, joint positions at the home switches; shape (2,)."""
    checks: tuple[Check, ...]
    warnings: tuple[str, ...]

    @property
    def hover(self) -> Counts:
        """Counts, joint positions with the fingertip above the key; shape (2,)."""
        return self.approach.start


def plan_press(
    rig: Rig, expected: Expectation | None = None, correction: Correction | None = None
) -> Trajectory:
    """Plan the press of a rig.

    Args:
        expected: Expected force against the finger; None for the arm alone, without a key.
        correction: Learned addition to the jack's rise; None for none.

    Raises:
        TrajectoryError: A check fails; the message lists all that fail and how to fix them.
    """
    trajectory = draft_press(rig, expected, correction)
    failed = [check for check in trajectory.checks if not check.holds]
    if failed:
        lines = [f"{check}; {check.how_to_fix}" for check in failed]
        raise TrajectoryError("the press cannot be made:\n  " + "\n  ".join(lines))
    return trajectory


def draft_press(
    rig: Rig, expected: Expectation | None = None, correction: Correction | None = None
) -> Trajectory:
    """Plan the press of a rig even if checks fail; see `plan_press`.

    Raises:
        TrajectoryError: No such motion exists: there is no cruise, or it is out of reach.
    """
    plain, permitted = press_law(rig.press), rig.press.speed_tolerance
    law = plain
    if correction is not None:
        law = correction.onto(plain)
        # Rounding may cost less than the correction removes.
        permitted = max(permitted, _change(plain, law))
    time = sample_times(rig, law.law)
    path = follow_key(rig, law.law.at(time))
    segments = quantise(rig, law.law, path.joints)
    cruise = _cruise(rig, law, segments)
    if cruise.error > rig.press.speed_tolerance:  # the encoders are coarse: search the knots
        searched = quantise(rig, law.law, path.joints, law)
        followed = _cruise(rig, law, searched)
        if followed.rms_error < cruise.rms_error:
            segments, cruise = searched, followed
    approach = _approach(rig, path)
    retreat = approach.reversed()
    force = None
    if expected is not None:
        _, normal = surface_axes(path.angle.position)
        against = expected.force_at(path.rise.position)
        force = carried_force(rig, path.angle, against)[:, None] * normal
    return Trajectory(
        **vars(path),
        law=law,
        time=time,
        torques=joint_torques(rig.arm, path.joints, force),
        tilt=tilt(path.angle.position, path.joints.position),
        segments=segments,
        approach=approach,
        retreat=retreat,
        cruise=cruise,
        loaded_speed_error=_loaded_speed_error(
            rig, path, time, plain.law.at(time).position, expected
        ),
        home=to_counts(rig.arm.home_angles, rig.arm.counts_per_revolution),
        checks=verify(rig, (approach, segments, retreat), cruise.error, permitted, expected),
        warnings=_warnings(law, cruise, float(path.rise.position.min()), expected),
    )


def _approach(rig: Rig, path: Path) -> Segments:
    """Return the approach, from `hover` down to the start of the press."""
    law = approach_law(rig.press)
    time = sample_times(rig, law)
    down = law.at(time)
    height = Motion(rig.press.hover - down.position, -down.velocity, -down.acceleration)
    return quantise(rig, law, follow_down(rig, path, height))


def sent_motion(rig: Rig, segments: Segments, ticks: Floats | Counts) -> Motion:
    """Return the jack's motion [m] that quantised segments give on a rigid arm.

    Args:
        ticks: Controller samples from the start, none outside the motion; shape (n,).
    """
    per_radian = rig.arm.counts_per_revolution / (2 * np.pi)
    cubics = segment_cubics(segments, per_radian, rig.controller.sample_period)
    return jack_under_finger(rig, motion_at(segments, cubics, ticks))


def _change(plain: PressLaw, law: PressLaw) -> float:
    """Return the largest change of the jack's speed by a correction in the cruise, relative."""
    times = law.law.times  # with the correction's knots
    times = times[(times >= law.cruise_start) & (times <= law.cruise_end)]
    planned = plain.law.at(times).velocity
    return float(np.abs(law.law.at(times).velocity - planned).max() / np.abs(planned).max())


def _cruise(rig: Rig, law: PressLaw, segments: Segments) -> Cruise:
    """Compute the cruise from the quantised segments."""
    period = rig.controller.sample_period
    ends = segments.ends * period
    slack = 1e-9 * period
    inside = np.flatnonzero((ends >= law.cruise_start - slack) & (ends <= law.cruise_end + slack))
    if len(inside) < 2:
        raise TrajectoryError(_too_short(law, period))
    first, last = inside[0], inside[-1]
    fine = segments.ends[first:last, None] + FINE * segments.samples[first:last, None]
    # The error changes abruptly where the law's jerk does, between two points of a segment too.
    knots = law.law.times[(law.law.times > ends[first]) & (law.law.times < ends[last])] / period
    ticks = np.union1d(fine, knots)
    jack = sent_motion(rig, segments, ticks)
    planned = law.law.at(ticks * period).velocity
    error = np.abs(jack.velocity - planned) / np.abs(planned).max()
    rms = np.sqrt(np.trapezoid(error**2, ticks) / (ticks[-1] - ticks[0]))
    start, end = float(ends[first]), float(ends[last])
    rise = float(jack.position[0]), float(jack.position[-1])
    speed = (rise[1] - rise[0]) / (end - start)
    return Cruise(start, end, rise, speed, float(error.max()), float(rms))


def _loaded_speed_error(
    rig: Rig, path: Path, time: Floats, plain: Floats, expected: Expectation | None
) -> float | None:
    """Return `Trajectory.loaded_speed_error` of a finger that the string's force deflects.

    The deflections d of the joints from their planned angles follow from the force F at the actual
    rise r = planned rise - (J^T n) d: M d'' + C d' + K d = (J^T n) (F(r) - F(0)), with stiffness K
    and damping C of the position loops, and in M the links, rotors and the key with its jacks.
    Implicit Euler steps, in each of which F is linear, except where it falls.

    Args:
        time: s, of the path, equidistant; shape (n,).
        plain: m, rise without a learned correction at the times of the path, shape (n,); its speed
            is the one to keep.
    """
    stiffness, damping = rig.arm.servo_stiffness, rig.arm.servo_damping
    if expected is None or stiffness is None:
        return None
    down = slice(0, int(np.argmax(path.rise.position)) + 1)
    angle, joints = path.angle.position[down], path.joints.position[down]
    levers = tip_torque(rig.arm, joints, surface_axes(angle)[1])
    per_tip = jack_law(rig.key, angle)[1] / rig.key.press_arm
    carried = moving_inertia(rig) / rig.key.press_arm**2
    masses = mass_matrix(rig.arm, joints) + carried * levers[:, :, None] * levers[:, None, :]
    if damping is None:
        own = np.diagonal(masses, axis1=1, axis2=2).mean(0)
        damping = 2 * 0.7 * np.sqrt(own * stiffness)  # Of the critical one, as usual position loops
    steps = np.arange(time[0], time[down][-1], (time[1] - time[0]) / 4)
    columns = np.column_stack([path.rise.position[down], levers, per_tip, masses.reshape(-1, 4)])
    rows = np.stack([np.interp(steps, time[down], column) for column in columns.T], 1)
    h, at_rest = steps[1] - steps[0], float(expected.force_at(path.rise.position[:1])[0])
    loops = np.diag(damping) * h + np.diag(stiffness) * h**2
    off, rate, rises = np.zeros(2), np.zeros(2), [float(rows[0, 0])]
    for planned, *lever, ratio, m11, m12, m21, m22 in rows[1:].tolist():
        pull, mass = np.array(lever), np.array([[m11, m12], [m21, m22]])
        rise = planned - ratio * float(pull @ off)
        here, on = expected.force_at(np.array([rise, rise + PROBE]))
        slope = max(0.0, float(on - here) / PROBE) * ratio
        forces = pull * (here - at_rest) - np.array(stiffness) * off
        yielding = mass + loops + h**2 * slope * np.outer(pull, pull)
        rate = np.linalg.solve(yielding, mass @ rate + h * forces)
        off = off + h * rate
        rises.append(planned - ratio * float(pull @ off))
        if rises[-1] > expected.release:
            break
    rise = np.array(rises)
    held = (rise[1:] > expected.contact) & (rise[1:] <= expected.release)
    if not held.any():
        return None
    wanted = np.diff(np.interp(steps[: len(rise)], time, plain))[held]
    error = np.diff(rise)[held] - wanted
    return float(np.sqrt(np.mean(error**2)) / np.abs(wanted).max())


def _too_short(law: PressLaw, period: float) -> str:
    lasting = f"of {(law.cruise_end - law.cruise_start) * 1e3:.3g} ms contains no complete segment"
    samples = f"of the controller (samples of {period * 1e3:.3g} ms)"
    if law.steady:
        return (
            f"press.jack_speed: the cruise {lasting} {samples}; lower jack_speed or raise jack_rise"
        )
    return f"press.gesture: it {lasting} {samples}; lower controller.sample_period"


def _warnings(
    law: PressLaw, cruise: Cruise, lowest: float, expected: Expectation | None
) -> tuple[str, ...]:
    if lowest < -1e-5:  # m
        return (
            f"the spline through press.gesture falls to {lowest * 1e3:.4g} mm, where the finger"
            " leaves the key; give more samples around its rests",
        )
    if expected is None or not law.steady:
        return ()
    first, last = (rise * 1e3 for rise in cruise.rise)
    contact, release = expected.contact * 1e3, expected.release * 1e3
    if first <= contact and release <= last:
        return ()
    return (
        f"the jack cruises from {first:.4g} to {last:.4g} mm of its rise, and the string is"
        f" expected to be held from {contact:.4g} to {release:.4g} mm; raise"
        " press.run_up_acceleration or run_down_acceleration, or lower press.jack_speed",
    )
