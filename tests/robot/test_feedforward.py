"""Torques from a measured force: virtual work, limits, and the force curve."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import HeldString, Phases
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.feedforward import measured_force, torque_table
from sautereau.trajectory.expected import Expectation
from sautereau.trajectory.press import plan_press

RIG = load_rig("paper")
PLAN = plan_press(RIG)
CONTACT, RELEASE = 1.944e-3, 3.4e-3
PEAK, AFTER, REST = 0.6, 0.05, 0.2


def expected(force):
    return Expectation(np.array([0.0, 0.02]), np.full(2, force), 0.002, 0.0034)


def curve(rise):
    """N, of the finger: a ramp while the string is held, then a little friction."""
    ramp = PEAK * np.clip((rise - CONTACT) / (RELEASE - CONTACT), 0, 1)
    return np.where(rise < RELEASE, ramp, AFTER)


@pytest.fixture
def press():
    rate = 51_200.0
    time = np.arange(0, PLAN.law.return_start, 1 / rate)
    rise = PLAN.law.law.at(time).position
    noise = 5e-3 * np.random.default_rng(0).standard_normal(len(time))
    samples = {"jack_rise": rise, "force": REST + curve(rise) + noise}
    return Press(Path("p.mcap"), RIG, True, time, samples, rate)


@pytest.fixture
def phases(press):
    rise, time = press.samples["jack_rise"], press.time
    contact, release = (float(time[np.argmax(rise > at)]) for at in (CONTACT, RELEASE))
    held = HeldString(contact, release, 0, 0, 0, PEAK, PEAK - AFTER, 0)
    return Phases(0.02, PLAN.law.bottom, (held,), 0.072, 0.07, 0.072, ())


def test_the_curve_is_the_force_above_that_at_rest(press, phases):
    found = measured_force(press, phases)
    at = np.linspace(0.5e-3, RELEASE - 0.05e-3, 50)
    np.testing.assert_allclose(found.force_at(at), curve(at), atol=6e-3)
    assert found.force_at(np.array([0.009])) == pytest.approx(AFTER, abs=1e-3)
    assert (found.contact, found.release) == pytest.approx((CONTACT, RELEASE), abs=3e-6)
    assert (np.diff(found.rise) > 0).all()


def test_the_curve_has_the_load_of_all_strings(press, phases):
    """A second string is touched at 4 mm, after the first release, and released at 5 mm."""
    rise = press.samples["jack_rise"]
    touched, released = 4e-3, 5e-3

    def second(rise):
        ramp = 0.8 * np.clip((rise - touched) / (released - touched), 0, 1)
        return np.where(rise < released, ramp, 0.0)

    press.samples["force"] += second(rise)
    contact, release = (float(press.time[np.argmax(rise > at)]) for at in (touched, released))
    later = HeldString(contact, release, 0, 0, 0, 0.8, 0.75, 0)
    found = measured_force(press, replace(phases, plucks=(*phases.plucks, later)))
    at = np.concatenate([np.linspace(0.5e-3, 3.35e-3, 50), np.linspace(3.45e-3, 4.95e-3, 50)])
    np.testing.assert_allclose(found.force_at(at), curve(at) + second(at), atol=1.5e-2)
    assert found.force_at(np.array([0.009])) == pytest.approx(AFTER, abs=1e-3)
    assert (found.contact, found.release) == pytest.approx((CONTACT, released), abs=3e-6)


def test_a_press_without_a_pluck_has_no_curve(press, phases):
    with pytest.raises(RobotError, match=r"p\.mcap: it has no pluck"):
        measured_force(press, replace(phases, plucks=()))


def test_the_torques_do_the_work_of_the_force(press, phases):
    """Torques times joint speeds are the force times the fingertip's speed along it."""
    measured = measured_force(press, phases)
    table = torque_table(RIG, PLAN, measured)
    pressing = PLAN.time < PLAN.law.bottom
    power = (table.torques * PLAN.joints.velocity).sum(axis=1)[pressing]
    angle = PLAN.angle.position
    normal = np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
    speed = (PLAN.fingertip.velocity * normal).sum(axis=1)[pressing]
    force = measured.force_at(PLAN.rise.position)[pressing]
    np.testing.assert_allclose(power, -force * speed, atol=1e-12)
    assert (-force * speed).max() > 0.03  # downwards: the finger pushes


def test_the_torques_are_zero_at_both_ends_and_constant_after_release(press, phases):
    table = torque_table(RIG, PLAN, measured_force(press, phases))
    assert np.abs(table.torques[[0, -1]]).max() < 1e-6
    hold = (PLAN.time > PLAN.law.bottom) & (PLAN.time < PLAN.law.return_start)
    assert np.ptp(table.torques[hold], axis=0).max() < 1e-9
    assert np.abs(table.torques[hold]).max() > 0
    np.testing.assert_array_equal(table.time, PLAN.time)
    assert (np.diff(np.abs(table.torques[PLAN.time > PLAN.law.return_start, 0])) <= 1e-12).all()


def test_torques_above_the_limit_are_refused():
    weak = with_values(RIG, {"arm.torque_limit": "0.5 N m"})
    with pytest.raises(RobotError, match=r"joint 1 would need .* above arm.torque_limit, 0\.5 N m"):
        torque_table(weak, PLAN, expected(20.0))


def test_no_force_needs_no_torque():
    assert not torque_table(RIG, PLAN, expected(0.0)).torques.any()


def test_a_controller_without_feed_forward_is_refused_before_anything_moves():
    with pytest.raises(RobotError, match="a controller of kind odrive adds no torques"):
        torque_table(with_values(RIG, {"controller.kind": "odrive"}), PLAN, expected(0.5))
