"""The steps of the set-up in order, and those that leave the key alone."""

import logging
import math
from collections.abc import Callable, Iterable, Iterator
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from sautereau.rig.capabilities import HomingKind, capabilities_of
from sautereau.rig.load import with_values
from sautereau.rig.schema import Rig
from sautereau.robot.controller import motion_controller
from sautereau.robot.drivers.galil.driver import GalilDriver
from sautereau.robot.drivers.powered_arm import PoweredArm
from sautereau.robot.drivers.serial_port import machine_ports
from sautereau.robot.errors import MotionFault, RobotError
from sautereau.robot.experiment.setup.contact import find_contact, locate_by_touch, play_measured
from sautereau.robot.experiment.setup.force import prove_force
from sautereau.robot.experiment.setup.step import Ask, Found, approach_speed, ask_first, homed
from sautereau.robot.experiment.setup.tap import tap_key
from sautereau.robot.experiment.setup.verify import alignment, motion, power_off
from sautereau.robot.experiment.setup.verify.workbench import Workbench
from sautereau.trajectory.dynamics import gravity_torque
from sautereau.trajectory.press import Trajectory, plan_press
from sautereau.trajectory.segments import to_counts

BEFORE_POWER = power_off.STEPS  # Group A: the amplifiers have no power
WITH_POWER = (*motion.STEPS, *alignment.STEPS, *motion.BY_HAND)
"""Group B: the motors are switched on with little torque."""
_WEIGHT = 2.0  # times the largest weight that the joints can hold


def verify(rig: Rig, ask: Ask) -> Found:
    """Verify the controller of a rig, and return what to store in its file.

    Raises:
        Surprise: The first step whose result contradicts the rig or the command reference.
        RobotError: A step failed in another way, or the operator did not agree. The motors are
            off after any error.
    """
    if rig.controller.kind != "galil":
        return Found(
            (f"verify: nothing is measured of a controller of kind {rig.controller.kind}",)
        )
    fraction = trial_torque(rig)
    low = {"controller.home_torque": 1.0}  # of the trial's
    controller = PoweredArm(GalilDriver, with_values(rig, low))
    bench = Workbench(rig, ask, controller)
    ask_first(
        ask,
        "verify",
        "Part A. Cut the power of the amplifiers, not that of the controller. Nothing can move"
        " then, and the program in the controller is replaced. Is it cut, and the emergency stop at"
        " hand?",
    )
    try:
        for step in BEFORE_POWER:
            step(bench)
            if controller.connected:
                allow_trial(bench, fraction)
        ask_first(
            ask,
            "verify",
            f"Part B. Give the amplifiers power. The motors are switched on with"
            f" {100 * fraction:.0f} % of the torque, and the arm moves slowly. Is its way"
            " free, and the emergency stop in your hand?",
        )
        for step in WITH_POWER:
            step(bench)
            allow_trial(bench, fraction)
    finally:
        controller.disconnect()
    results = [*bench.lines, *(f"{warning} (warning)" for warning in bench.warnings)]
    bench.values["controller.verified_results"] = results
    bench.values["controller.verified_on"] = datetime.now(UTC).date().isoformat()
    return Found(tuple(bench.lines), bench.values, bench.figures, tuple(bench.warnings))


def allow_trial(bench: Workbench, fraction: float) -> None:
    """Let the controller be switched on although it is not verified, with little torque."""
    driver = bench.driver
    if not driver.on_trial:
        driver.on_trial, driver.settings.trial = True, fraction
        driver.settings.limit_torque(1.0)


def trial_torque(rig: Rig) -> float:
    """Return the fraction of the torque limit that the verification uses."""
    joints = np.array([[0.0, 0.0], [rig.arm.home_angles[0], rig.arm.home_angles[1]]])
    weight = float(np.abs(gravity_torque(rig.arm, joints)).max())
    return min(1.0, max(0.05, _WEIGHT * weight / rig.arm.torque_limit))


_LOG = logging.getLogger(__name__)
TURN = math.radians(10)  # rad, that each joint turns in the check of its encoder
SCALE = 0.05  # Relative deviation of a measured turn that is accepted, as precise as a protractor
TOUCHED = 0.2  # N, above which the finger has touched something in the air


def find_port(rig: Rig, ask: Ask, ports: Iterable[str] | None = None) -> Found:
    """Try to connect at every serial port of this machine, that of the rig first.

    Args:
        ask: Asked before anything is sent to a port that is not the rig's.
        ports: Those to try; None for all of this machine.

    Raises:
        RobotError: No port has a usable controller; the message lists the answer of each.
    """
    mine = rig.controller.port
    others = [port for port in (machine_ports() if ports is None else ports) if port != mine]
    answers = []
    if "://" in mine or Path(mine).exists():
        if found := _try_port(rig, mine, answers):
            return found
    else:
        answers.append(f"{mine} (controller.port) does not exist")
    if others:
        ask_first(
            ask,
            "port",
            f"Send {', '.join(others)} a question that only a {rig.controller.kind} controller"
            " understands? Any other device on them may misinterpret it.",
        )
    for port in others:
        if found := _try_port(rig, port, answers):
            return found
    raise RobotError(
        "setup port: no usable controller was found; plug it in and switch it on, or fix what was"
        " reported:\n  " + "\n  ".join(answers)
    )


def _try_port(rig: Rig, port: str, answers: list[str]) -> Found | None:
    """Return what is at a port, at any baud rate; None with the reasons added to ``answers``."""
    settings = rig.controller
    rates = dict.fromkeys((settings.baud_rate, 115_200, 19_200, 57_600, 38_400, 9_600))
    if "://" in port:
        rates = {settings.baud_rate: None}
    reasons: dict[str, list[int]] = {}
    for rate in rates:
        values = {"controller.port": port, "controller.baud_rate": rate}
        try:
            with motion_controller(with_values(rig, values)) as controller:
                identity = controller.identity
        except RobotError as error:
            reasons.setdefault(str(error), []).append(rate)
            continue
        now = {"controller.port": settings.port, "controller.baud_rate": settings.baud_rate}
        changed = {key: value for key, value in values.items() if value != now[key]}
        return Found((f"port: {port} at {rate} baud is {identity}",), changed)
    answers += [f"at {', '.join(map(str, at))} baud: {reason}" for reason, at in reasons.items()]
    return None


def identify(rig: Rig, ask: Ask) -> Found:
    """Connect as a press does: the controller is identified, and its limits are set and verified.

    Nothing moves, and the operator is not asked; the motors are switched off.

    Raises:
        RobotError: There is no controller, or a press cannot be made with it.
    """
    with motion_controller(rig) as controller:
        settings = rig.controller
        simulated = ", SIMULATED" if controller.simulated else ""
        return Found(
            (
                f"controller: {controller.identity}{simulated}, on {settings.port}",
                "it uses the limits of the rig; its motors are off",
            )
        )


def find_home(rig: Rig, ask: Ask) -> Found:
    """Find home, and check the switches where there are any.

    Raises:
        RobotError: A switch is not found, or has moved; the motors are off.
    """
    seeks = capabilities_of(rig).homing is HomingKind.SWITCHES
    moves = "moves slowly to its home switches" if seeks else "gets power, and stays where it is"
    ask_first(ask, "home", f"The arm {moves}. Is its way free?")
    with homed(rig) as controller:
        controller.check_home()
        at = controller.positions()
    angles = np.degrees(at * rig.arm.radians_per_count)
    how = f"found twice within {rig.controller.home_tolerance} counts"
    how = how if seeks else "known from the absolute encoders"
    return Found((f"home: {how}; the arm is at {angles[0]:.3f} and {angles[1]:.3f} deg",))


def check_encoders(rig: Rig, ask: Ask) -> Found:
    """Turn one joint after the other a little, and compare with what the operator measures.

    Raises:
        RobotError: A joint turns the wrong way, or the scales of the joints differ; the motors
            are off.
    """
    degrees = math.degrees(TURN)
    ask_first(
        ask,
        "encoders",
        f"The arm homes, then each joint turns by {degrees:g} deg and back. Is its way free, and"
        " is a protractor at hand?",
    )
    home = np.array(rig.arm.home_angles)
    middle = (np.array(rig.arm.lower_limits) + np.array(rig.arm.upper_limits)) / 2
    scales: list[float | None] = []
    with homed(rig) as controller:
        for joint in range(2):
            turn = np.zeros(2)
            turn[joint] = TURN if middle[joint] >= home[joint] else -TURN
            scale = rig.arm.counts_per_revolution
            start, end = to_counts(home, scale), to_counts(home + turn, scale)
            controller.move_to(end, approach_speed(rig))
            answer = ask.number(
                f"By how much has joint {joint + 1} turned? With the jack to the right of the key's"
                " pin, counter-clockwise is positive.",
                "rad",
                float(turn[joint]),
            )
            scales.append(None if answer is None else answer / float(turn[joint]))
            controller.move_to(start, approach_speed(rig))
        if faults := _turn_faults(scales):
            raise MotionFault(f"setup encoders: {'; '.join(faults)}")
    known = [scale for scale in scales if scale is not None]
    if not known:
        line = "encoders: both joints moved and returned; the turns were not measured"
        return Found((line,), warnings=("direction and scale of the encoders are not checked",))
    scale = sum(known) / len(known)
    figures = {f"joint_{i}_scale": s for i, s in enumerate(scales, 1) if s is not None}
    lines = (f"encoders: the joints turn the right way, {scale:.3f} times as far as requested",)
    if abs(scale - 1) <= SCALE:
        return Found(lines, figures=figures)
    counts = round(rig.arm.counts_per_revolution / scale)
    advice = f"{counts} counts per turn would fit; take the data sheet's nearest value"
    return Found((*lines, advice), {"arm.counts_per_revolution": counts}, figures)


def _turn_faults(scales: list[float | None]) -> list[str]:
    """Return the faults of the measured turns, as fractions of the requested turns."""
    faults = []
    for joint, scale in enumerate(scales, 1):
        if scale is not None and abs(scale) < SCALE:
            faults.append(f"joint {joint} has not turned; check its coupling and its amplifier")
        elif scale is not None and scale < 0:
            faults.append(
                f"joint {joint} turns the wrong way; let the controller count the other way (CE)"
                " and swap the motor's leads, or its command's sign (MT)"
            )
    known = [scale for scale in scales if scale is not None]
    if not faults and len(known) == 2 and abs(known[0] / known[1] - 1) > 2 * SCALE:
        faults.append(
            f"joint 1 turned {known[0]:.3g} and joint 2 {known[1]:.3g} times as far as requested,"
            " and the rig has one arm.counts_per_revolution for both; give both encoders the same"
            " resolution"
        )
    return faults


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
    # In the air the finger tilts as it likes: it measures no force.
    lowered = {"arm.base_z": f"{rig.arm.base_z - lift!r} m", "arm.tilt_limit": "180 deg"}
    lower = with_values(rig, lowered)
    return plan_press(lower), lift


STEPS: dict[str, Callable[[Rig, Ask], Found]] = {
    "port": find_port,
    "controller": identify,
    "verify": verify,
    "home": find_home,
    "encoders": check_encoders,
    "force": prove_force,
    "contact": find_contact,
    "touch": locate_by_touch,
    "tap": tap_key,
    "dry-run": play_in_air,
}
"""By name."""


def make_steps(rig: Rig, ask: Ask, step: str | None = None) -> Iterator[tuple[str, Found]]:
    """Run one step, or all, each with the values that those before it have found.

    Args:
        step: Its name; None for all.

    Raises:
        SautereauError: A step failed; the arm has been stopped and switched off.
    """
    if step is not None and step not in STEPS:
        raise RobotError(f"setup: there is no step {step!r}; the steps are {', '.join(STEPS)}")
    for name in STEPS if step is None else (step,):
        _LOG.info("setup step %s", name)
        found = STEPS[name](rig, ask)
        yield name, found
        rig = with_values(rig, found.plain)
