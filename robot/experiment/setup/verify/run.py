"""Verify a controller: every step in order, up to the first surprise."""

from datetime import UTC, datetime

import numpy as np

from sautereau.rig.load import with_values
from sautereau.rig.schema import Rig
from sautereau.robot.drivers.galil.driver import GalilDriver
from sautereau.robot.drivers.powered_arm import PoweredArm
from sautereau.robot.experiment.setup.step import Ask, Found, ask_first
from sautereau.robot.experiment.setup.verify import alignment, motion, power_off
from sautereau.robot.experiment.setup.verify.workbench import Workbench
from sautereau.trajectory.dynamics import gravity_torque

BEFORE_POWER = power_off.STEPS  # Group A: the amplifiers have no power
WITH_POWER = (*motion.STEPS, *alignment.STEPS, *motion.BY_HAND)
"""Group B: the motors are switched on with little torque."""
LEAST_TORQUE = 0.05  # Fraction of the torque limit in group B; more where the arm's weight needs it
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
    return min(1.0, max(LEAST_TORQUE, _WEIGHT * weight / rig.arm.torque_limit))
