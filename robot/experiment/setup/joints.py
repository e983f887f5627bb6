"""Home the joints, and see that they turn the right way and as far as they say."""

import math

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.robot.errors import MotionFault
from sautereau.robot.experiment.setup.step import (
    Ask,
    Found,
    approach_speed,
    ask_first,
    counts_per_radian,
    homed,
)

TURN = math.radians(10)
"""rad, that each joint turns in the check of its encoder."""
SCALE = 0.05
"""1, by which a joint may turn more or less than it should: a protractor sees no less."""


def find_home(rig: Rig, ask: Ask) -> Found:
    """Find the home switches, and find them again.

    Raises:
        RobotError: A switch is not found, or not where it was; the motors are off.
    """
    ask_first(ask, "home", "The arm looks for its home switches, slowly. Is its way free?")
    with homed(rig) as controller:
        controller.check_home()
        at = controller.positions()
    angles = np.degrees(at / counts_per_radian(rig))
    return Found(
        (
            f"home: found twice within {rig.controller.home_tolerance} counts; the arm stands at"
            f" {angles[0]:.3f} and {angles[1]:.3f} deg",
        )
    )


def check_encoders(rig: Rig, ask: Ask) -> Found:
    """Turn one joint after the other a little, and compare with what is seen.

    Raises:
        RobotError: A joint turns the wrong way, or the two by different shares; the motors
            are off.
    """
    degrees = math.degrees(TURN)
    ask_first(
        ask,
        "encoders",
        f"The arm homes, then each joint turns by {degrees:g} deg and back. Is its way free, and"
        " is a protractor at hand?",
    )
    home, middle = np.array(rig.arm.home_angles), _middle(rig)
    seen: list[float | None] = []
    with homed(rig) as controller:
        for joint in range(2):
            turn = np.zeros(2)
            turn[joint] = TURN if middle[joint] >= home[joint] else -TURN
            start, end = ((home + a) * counts_per_radian(rig) for a in (np.zeros(2), turn))
            controller.move_to(np.rint(end).astype(np.int64), approach_speed(rig))
            answer = ask.number(
                f"By how much has joint {joint + 1} turned? Seen with the jack to the right of the"
                " key's pin, counter-clockwise counts positive.",
                "rad",
                float(turn[joint]),
            )
            seen.append(None if answer is None else answer / float(turn[joint]))
            controller.move_to(np.rint(start).astype(np.int64), approach_speed(rig))
        if faults := _faults(seen):
            raise MotionFault(f"setup encoders: {'; '.join(faults)}")
    return _scale(rig, seen)


def _middle(rig: Rig) -> np.ndarray:
    return (np.array(rig.arm.lower_limits) + np.array(rig.arm.upper_limits)) / 2


def _faults(seen: list[float | None]) -> list[str]:
    """Return what is wrong with the shares of the turns asked for that were seen."""
    faults = []
    for joint, share in enumerate(seen, 1):
        if share is not None and abs(share) < SCALE:
            faults.append(f"joint {joint} has not turned; check its coupling and its amplifier")
        elif share is not None and share < 0:
            faults.append(
                f"joint {joint} turns the wrong way; let the controller count the other way (CE)"
                " and swap the motor's leads, or its command's sign (MT)"
            )
    known = [share for share in seen if share is not None]
    if not faults and len(known) == 2 and abs(known[0] / known[1] - 1) > 2 * SCALE:
        faults.append(
            f"joint 1 turned {known[0]:.3g} and joint 2 {known[1]:.3g} times as far as asked for,"
            " and the rig has one arm.counts_per_revolution for both; give both encoders the same"
            " resolution"
        )
    return faults


def _scale(rig: Rig, seen: list[float | None]) -> Found:
    known = [share for share in seen if share is not None]
    if not known:
        told = "encoders: both joints went and came back; nobody measured by how much"
        return Found((told,), warnings=("direction and scale of the encoders are not checked",))
    share = sum(known) / len(known)
    figures = {f"joint_{i}_scale": s for i, s in enumerate(seen, 1) if s is not None}
    lines = (f"encoders: the joints turn the right way, {share:.3f} times as far as asked for",)
    if abs(share - 1) <= SCALE:
        return Found(lines, figures=figures)
    counts = round(rig.arm.counts_per_revolution / share)
    told = f"{counts} counts a turn would fit; take the encoder's data sheet's number next to that"
    return Found((*lines, told), {"arm.counts_per_revolution": counts}, figures)
