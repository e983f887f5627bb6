"""Approach, press and retreat of the finger."""

import numpy as np
import pytest

from sautereau.trajectory.arm import fingertip_motion, follow_down, follow_key
from sautereau.trajectory.key import key_under_fingertip
from sautereau.trajectory.motion import Motion
from sautereau.trajectory.press import plan_press
from tests.trajectory.brute_force import close, spline


def cosine_rise(t):
    return Motion(0.005 * (1 - np.cos(9 * t)), 0.045 * np.sin(9 * t), 0.405 * np.cos(9 * t))


@pytest.mark.parametrize("hold", ["point", "normal"])
def test_the_complete_mechanism_follows_the_rise(bench, hold):
    rig = bench(press__hold=hold)
    rise = cosine_rise(np.linspace(0, 0.7, 101))
    path = follow_key(rig, rise)
    centre = fingertip_motion(rig.arm, path.joints)
    under = key_under_fingertip(rig.key, rig.arm.fingertip_radius, centre)
    for found, place, planned in zip(under, (1e-12, 1e-10, 1e-8), path.angle, strict=True):
        close(found, planned, place)
    for found, planned in zip(centre, path.fingertip, strict=True):
        close(found, planned, 1e-9)
    assert (hold == "point") == (np.abs(path.slide).max() == 0)


@pytest.mark.parametrize("hold", ["point", "normal"])
def test_the_approach_is_straight_along_the_normal_of_the_key_at_rest(bench, hold):
    rig = bench(press__hold=hold)
    contact = follow_key(rig, cosine_rise(np.linspace(0, 0.7, 11)))
    s = np.linspace(0, 1, 51)
    height = Motion(0.02 * (1 - s), np.full_like(s, -0.02), np.zeros_like(s))
    joints = follow_down(rig, contact, height)
    tip = fingertip_motion(rig.arm, joints)
    start = contact.fingertip.position[0]
    assert np.abs(tip.position[:, 0] - start[0]).max() < 1e-13
    assert np.abs(tip.position[:, 1] - start[1] - height.position).max() < 1e-13
    assert np.abs(tip.velocity - [0.0, -0.02]).max() < 1e-12
    assert np.abs(tip.acceleration).max() < 1e-11
    assert np.abs(joints.position[-1] - contact.joints.position[0]).max() < 1e-12


@pytest.mark.parametrize("elbow", ["up", "down"])
def test_the_approach_stays_in_the_turn_of_the_press(bench, elbow):
    """With the base behind the key, joint 1 crosses half a turn between hover and key."""
    rig = bench(
        arm__base_x="20 mm",
        arm__base_z="76 mm",
        arm__lower_limits=["90 deg", "-170 deg"],
        arm__upper_limits=["270 deg", "170 deg"],
        arm__elbow=elbow,
    )
    contact = follow_key(rig, cosine_rise(np.linspace(0, 0.7, 11)))
    s = np.linspace(0, 1, 51)
    joints = follow_down(rig, contact, Motion(0.05 * (1 - s), 0 * s, 0 * s)).position
    assert np.abs(joints[-1] - contact.joints.position[0]).max() < 1e-12
    assert np.abs(np.diff(joints, axis=0)).max() < 0.1


@pytest.mark.parametrize("hold", ["point", "normal"])
def test_approach_press_and_retreat_are_continuous(bench, hold):
    rig = bench(press__hold=hold)
    plan = plan_press(rig)
    assert (plan.approach.end == plan.segments.start).all()
    assert (plan.segments.end == plan.segments.start).all()
    assert (plan.retreat.start == plan.segments.end).all()
    assert (plan.retreat.end == plan.hover).all()
    turn, period, arm = 2 * np.pi / rig.arm.counts_per_revolution, 976.5625e-6, rig.arm
    for segments in (plan.approach, plan.retreat):
        curve = spline(segments, period)
        first, second = curve(np.linspace(0, curve.x[-1], 5001)).T * turn
        total = first + second
        x = arm.base_x + arm.upper_length * np.cos(first) + arm.lower_length * np.cos(total)
        z = arm.base_z + arm.upper_length * np.sin(first) + arm.lower_length * np.sin(total)
        assert np.ptp(x) < 2e-6
        assert np.abs(x - plan.fingertip.position[0, 0]).max() < 2e-6
        assert z.max() == pytest.approx(0.014 + rig.press.hover, abs=1e-6)
        assert z.min() == pytest.approx(0.014, abs=1e-6)
        down = 1 if segments is plan.approach else -1
        assert (down * np.diff(z)).max() < 1e-7


@pytest.mark.parametrize("settle", ["0 ms", "20 ms", "0.3 s"])
def test_the_finger_rests_on_the_key_before_it_accelerates(bench, settle):
    rig = bench(press__settle=settle)
    plan = plan_press(rig)
    curve = spline(plan.segments, rig.controller.sample_period)
    # The last segment of the rest may start one grain of two samples early.
    rest = rig.press.settle - 2 * rig.controller.sample_period
    t = np.linspace(0, max(rest, 0), 200)
    assert (curve(t) == plan.segments.start).all()
    assert (plan.rise.position[plan.time <= rig.press.settle] == 0).all()
    assert curve(rig.press.settle + 0.01)[1] != plan.segments.start[1]
