"""A correction of the jack's rise: an exact sum, refused if it does not fit."""

import numpy as np
import pytest

from sautereau.rig.load import load_rig
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.learning import Correction
from sautereau.trajectory.press import draft_press, plan_press
from sautereau.trajectory.timing import press_law

RIG = load_rig("paper")
LAW = press_law(RIG.press)
TIME = np.linspace(LAW.start, LAW.return_start, 60)


def hump(height=2e-4):
    return height * np.sin(np.pi * (TIME - TIME[0]) / (TIME[-1] - TIME[0])) ** 4


def made(height=2e-4):
    rise = hump(height)
    rise[-1] = 0.0
    return Correction(TIME, rise)


def test_the_law_is_the_sum():
    law = made().onto(LAW)
    np.testing.assert_allclose(
        law.law.at(TIME).position, LAW.law.at(TIME).position + hump(), atol=1e-15
    )
    fine = np.linspace(0, LAW.law.duration, 40001)
    motion = law.law.at(fine)
    for value, rate in ((motion.position, motion.velocity), (motion.velocity, motion.acceleration)):
        step = fine[1] - fine[0]  # trapezoids are exact but for the corners of the acceleration
        steps = np.diff(value) - step * (rate[1:] + rate[:-1]) / 2
        np.testing.assert_allclose(steps, 0, atol=3000 * step**2)


def test_a_zero_correction_changes_nothing():
    law = Correction(TIME, np.zeros_like(TIME)).onto(LAW)
    fine = np.linspace(0, LAW.law.duration, 5001)
    for ours, theirs in zip(law.law.at(fine), LAW.law.at(fine), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-12)


def test_outside_its_knots_the_press_is_as_planned():
    law = made().onto(LAW)
    outside = np.concatenate(
        [np.linspace(0, LAW.start, 100), np.linspace(LAW.return_start, LAW.law.duration, 100)]
    )
    for ours, theirs in zip(law.law.at(outside)[:2], LAW.law.at(outside)[:2], strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-12)


def test_a_corrected_press_is_planned_and_checked():
    plan = plan_press(RIG, correction=made(5e-5))
    assert plan.cruise.error <= RIG.press.speed_tolerance
    assert plan.segments.end.tolist() == plan_press(RIG).segments.end.tolist()


def test_a_correction_beyond_the_limits_fails_the_checks():
    assert not all(check.holds for check in draft_press(RIG, correction=made(8e-3)).checks)


@pytest.mark.parametrize(
    ("time", "rise", "says"),
    [
        (TIME, np.ones(60), "at its ends"),
        (TIME[::-1], np.zeros(60), "do not increase"),
        (TIME, np.full(60, np.nan), "not finite"),
        (TIME, np.zeros(59), "shape"),
        (TIME[:2], np.zeros(2), "3 or more"),
    ],
)
def test_refused(time, rise, says):
    with pytest.raises(TrajectoryError, match=says):
        Correction(time, rise)


def test_a_correction_of_another_press_is_refused():
    with pytest.raises(TrajectoryError, match="another press"):
        Correction(TIME + 0.05, np.zeros_like(TIME)).onto(LAW)
