"""Touch the key at a few points, and find where the base of the robot really is."""

import math

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.robot.experiment.setup.contact import GENTLY, Creep, Touch, touch_at
from sautereau.robot.experiment.setup.step import Ask, Found, ask_first, homed
from sautereau.trajectory.mount.locate import Located, locate_base

SHARES = (1.0, 0.9, 0.8)
"""Of the pressing point's distance from the pin, where the key is touched."""


def locate_by_touch(rig: Rig, ask: Ask, creep: Creep = GENTLY) -> Found:
    """Touch the key at three points, and estimate where the base is.

    The joints' zeros are taken as true.

    Raises:
        RobotError: A touch fails; the motors are off.
        TrajectoryError: The touches determine nothing.
    """
    points = [share * rig.key.press_arm for share in SHARES]
    ask_first(
        ask,
        "touch",
        f"The arm homes and creeps down on the key at {len(points)} points, until it feels"
        f" {creep.sense * 1e3:g} mN; at more than {creep.limit:g} N the motors go off. Is its way"
        " free, and is a rule at hand?",
    )
    touches: list[Touch] = []
    where: list[float | None] = []
    with homed(rig) as controller:
        for point in points:
            touches.append(touch_at(rig, controller, point, creep))
            where.append(
                ask.number(
                    "How far in front of the balance pin has the fingertip touched the key?",
                    "m",
                    point,
                )
            )
    measured = all(distance is not None for distance in where)
    along = [-(p if w is None else w) for p, w in zip(points, where, strict=True)]
    joints = np.array([touch.joints for touch in touches])
    return _found(rig, locate_base(rig, joints, np.array(along), offsets=0), touches, measured)


def _found(rig: Rig, located: Located, touches: list[Touch], measured: bool) -> Found:
    """Return what goes into the rig, which is what differs by more than its uncertainty."""
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
        doubts.append("nobody measured where along the key it was touched: base_x is as it was")
    along = f"+-{std_x * 1e3:.2f}" if measured else "as it was"
    heights = [touch.height for touch in touches]
    return Found(
        (
            f"touch: the base is at x = {base_x * 1e3:.2f} mm ({along}), z ="
            f" {located.base_z * 1e3:.2f} mm (+-{std_z * 1e3:.2f}), {away * 1e3:.2f} mm from"
            " where the rig has it",
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
