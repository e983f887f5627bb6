"""Home the joints, and check the sign and scale of their encoders."""

import math

import numpy as np

from sautereau.rig.capabilities import HomingKind, capabilities_of
from sautereau.rig.schema import Rig
from sautereau.robot.errors import MotionFault
from sautereau.robot.experiment.setup.step import Ask, Found, approach_speed, ask_first, homed
from sautereau.trajectory.segments import to_counts

TURN = math.radians(10)  # rad, that each joint turns in the check of its encoder
SCALE = 0.05  # Relative deviation of a measured turn that is accepted, as precise as a protractor


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
        if faults := _faults(scales):
            raise MotionFault(f"setup encoders: {'; '.join(faults)}")
    return _scale(rig, scales)


def _faults(scales: list[float | None]) -> list[str]:
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


def _scale(rig: Rig, scales: list[float | None]) -> Found:
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
