"""Touch the key at a few points, and estimate the position of the robot's base."""

import math

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.robot.experiment.setup.contact import GENTLY, Creep, Touch, touch_at
from sautereau.robot.experiment.setup.step import Ask, Found, ask_first, homed
from sautereau.trajectory.mount.locate import Located, locate_base

FRACTIONS = (1.0, 0.9, 0.8)
"""Points where the key is touched, as fractions of the pressing point's distance from the pin."""


def locate_by_touch(rig: Rig, ask: Ask, creep: Creep = GENTLY) -> Found:
    """Touch the key at three points, and estimate the position of the base.

    The zeros of the joints are assumed to be exact.

    Raises:
        RobotError: A touch fails; the motors are off.
        TrajectoryError: The base is not identifiable from the contacts.
    """
    points = [fraction * rig.key.press_arm for fraction in FRACTIONS]
    ask_first(
        ask,
        "touch",
        f"The arm homes and approaches the key at {len(points)} points, until the force rises by"
        f" {creep.sense * 1e3:g} mN; above {creep.limit:g} N the motors go off. Is its way free,"
        " and is a rule at hand?",
    )
    touches: list[Touch] = []
    where: list[float | None] = []
    with homed(rig) as controller:
        for point in points:
            touches.append(touch_at(rig, controller, point, creep))
            where.append(
                ask.number(
                    "How far in front of the balance pin did the fingertip touch the key?",
                    "m",
                    point,
                )
            )
    measured = all(distance is not None for distance in where)
    along = [-(p if w is None else w) for p, w in zip(points, where, strict=True)]
    joints = np.array([touch.joints for touch in touches])
    return _found(rig, locate_base(rig, joints, np.array(along), offsets=0), touches, measured)


def _found(rig: Rig, located: Located, touches: list[Touch], measured: bool) -> Found:
    """Return the values for the rig: those that differ from it by more than their uncertainty."""
    base_x = located.base_x if measured else rig.arm.base_x
    away = math.hypot(base_x - rig.arm.base_x, located.base_z - rig.arm.base_z)
    values: dict[str, str | int] = {}
    std_x, std_z = located.std
    if abs(located.base_z - rig.arm.base_z) > std_z:
        values["arm.base_z"] = f"{located.base_z * 1e3:.3f} mm"
    if abs(base_x - rig.arm.base_x) > std_x:
        values["arm.base_x"] = f"{base_x * 1e3:.3f} mm"
    doubts = list(located.warnings)
    if not measured:
        doubts.append("the points of contact along the key were not measured: base_x is unchanged")
    along = f"+-{std_x * 1e3:.2f}" if measured else "unchanged"
    heights = [touch.height for touch in touches]
    return Found(
        (
            f"touch: the base is at x = {base_x * 1e3:.2f} mm ({along}), z ="
            f" {located.base_z * 1e3:.2f} mm (+-{std_z * 1e3:.2f}), {away * 1e3:.2f} mm from"
            " the base in the rig",
        ),
        values,
        {
            "base_x": base_x,
            "base_z": located.base_z,
            "away": away,
            "residual": located.residual,
            "lowest": min(heights),
            "highest": max(heights),
        },
        tuple(doubts),
    )
