"""Settings of an ODrive: those made before its motors are on, and those it must have already."""

import math

from sautereau.rig.schema import Rig
from sautereau.robot.drivers.odrive.line import OdriveLine
from sautereau.robot.drivers.odrive.setpoints import bandwidth

AXES = ("axis0", "axis1")
"""Names of the axes, which turn joints 1 and 2."""
_POSITION_CONTROL = 3


def set_limits(line: OdriveLine, rig: Rig) -> None:
    """Set limits, filter and watchdog timeout of both axes; the watchdog does not run yet.

    Nothing is saved in the controller.

    Raises:
        RobotError: Lists every setting that the controller does not take, or that differs from
            the rig file.
    """
    arm, controller = rig.arm, rig.controller
    faults, settings = [], {}
    for name, ratio in zip(AXES, arm.gear_ratios, strict=True):
        for key, due in (
            (f"{name}.encoder.config.cpr", arm.counts_per_revolution / ratio),
            (f"{name}.controller.config.circular_setpoints", 0.0),
        ):
            if (value := line.read(key)) != due:
                faults.append(f"{key} is {value:g} and should be {due:.9g}")
        settings |= {
            f"{name}.config.watchdog_timeout": controller.watchdog_period,
            f"{name}.controller.config.control_mode": _POSITION_CONTROL,
            f"{name}.controller.config.vel_limit": arm.speed_limit * ratio / (2 * math.pi),
            f"{name}.motor.config.torque_lim": arm.torque_limit / ratio,
            f"{name}.controller.config.input_filter_bandwidth": bandwidth(controller.sample_period),
            f"{name}.min_endstop.config.offset": 0.0,
        }
    line.refuse(faults)
    line.set(settings)
