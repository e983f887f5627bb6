"""The two-link arm: both holds and both elbows, against the fingertip and differences."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sautereau.rig.load import load_rig
from sautereau.trajectory.arm import (
    base,
    elbow_sign,
    fingertip_motion,
    fingertip_place,
    joints_holding_normal,
    joints_holding_point,
    reach_margins,
    tilt,
)
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.key import key_under_fingertip, point_on_key, surface_axes
from sautereau.trajectory.motion import Motion, dot
from tests.trajectory.brute_force import close

PAPER = load_rig()
KEY = PAPER.key
TIME = np.linspace(0, 1, 61)


def rocking(t):
    return Motion(0.02 - 0.03 * np.cos(5 * t), 0.15 * np.sin(5 * t), 0.75 * np.cos(5 * t))


def along_the_key(arm, angle):
    return point_on_key(angle, -KEY.press_arm, KEY.surface_height + arm.fingertip_radius)


@st.composite
def arms(draw):
    """Arms with the pressing point well inside their reach."""
    upper, lower = draw(st.floats(0.06, 0.25)), draw(st.floats(0.06, 0.25))
    bend = draw(st.floats(0.3, 2.8))
    distance = np.sqrt(upper**2 + lower**2 + 2 * upper * lower * np.cos(bend))
    away = max(distance, abs(upper - lower) + 0.02)
    direction = draw(st.floats(-np.pi, np.pi))
    return PAPER.arm.model_copy(
        update={
            "upper_length": upper,
            "lower_length": lower,
            "elbow": draw(st.sampled_from(["up", "down"])),
            "base_x": -KEY.press_arm + away * np.cos(direction),
            "base_z": 0.014 + away * np.sin(direction),
        }
    )


@st.composite
def standing_arms(draw):
    """Arms whose elbow, with link 2 upright on the key, is at most link 1 from the base."""
    upper, lower = draw(st.floats(0.06, 0.25)), draw(st.floats(0.06, 0.25))
    above = draw(st.floats(-0.7, 0.7)) * upper
    side = draw(st.sampled_from([-1, 1]))
    return PAPER.arm.model_copy(
        update={
            "upper_length": upper,
            "lower_length": lower,
            "base_x": -KEY.press_arm + side * np.sqrt(upper**2 - above**2),
            "base_z": 0.014 + lower + above,
        }
    )


def within_reach(arm, path):
    outside, inside = reach_margins(arm, path.position)
    return min(outside.min(), inside.min()) > 0.003


def test_a_straight_arm_and_a_right_angle():
    still = np.zeros((1, 2))
    arm = PAPER.arm.model_copy(update={"base_x": 0.0, "base_z": 0.0})
    tip = fingertip_motion(arm, Motion(np.array([[0.0, -np.pi / 2]]), still, still))
    assert tip.position[0] == pytest.approx([0.12, -0.10])
    spun = fingertip_motion(arm, Motion(still, np.array([[2.0, 0.0]]), still))
    assert spun.velocity[0] == pytest.approx([0.0, 0.44])
    assert spun.acceleration[0] == pytest.approx([-0.88, 0.0])


@given(arms())
def test_holding_the_point_brings_the_fingertip_there(arm):
    path = along_the_key(arm, rocking(TIME))
    assume(within_reach(arm, path))
    joints = joints_holding_point(arm, path)
    back = fingertip_motion(arm, joints)
    assert np.abs(back.position - path.position).max() < 1e-12
    close(back.velocity, path.velocity, 1e-10)
    close(back.acceleration, path.acceleration, 1e-9)
    assert (np.sign(joints.position[:, 1]) == elbow_sign(arm)).all()


@given(standing_arms())
def test_holding_the_normal_keeps_link_2_upright(arm):
    angle = rocking(TIME)
    joints, slide = joints_holding_normal(arm, KEY, angle)
    assert np.abs(tilt(angle.position, joints.position)).max() < 1e-12
    first = joints.position[:, 0]
    elbow = base(arm) + arm.upper_length * np.stack([np.cos(first), np.sin(first)], -1)
    tangent, normal = surface_axes(angle.position)
    height = KEY.surface_height + arm.fingertip_radius + arm.lower_length
    assert dot(elbow, normal) == pytest.approx(height, abs=1e-12)
    assert dot(elbow, tangent) == pytest.approx(slide - KEY.press_arm, abs=1e-12)
    tip = fingertip_motion(arm, joints)
    expected = elbow - arm.lower_length * normal
    assert np.abs(tip.position - expected).max() < 1e-12
    under = key_under_fingertip(KEY, arm.fingertip_radius, tip)
    assert np.abs(under.position - angle.position).max() < 1e-11
    close(under.velocity, angle.velocity, 1e-9)
    close(under.acceleration, angle.acceleration, 1e-8)


@given(arms(), st.integers(-3, 3))
def test_joint_1_starts_in_the_turn_of_its_limits(arm, turns):
    middle = 2 * np.pi * turns + 1.0
    arm = arm.model_copy(
        update={
            "lower_limits": (middle - 1, arm.lower_limits[1]),
            "upper_limits": (middle + 1, arm.upper_limits[1]),
        }
    )
    path = along_the_key(arm, rocking(TIME))
    assume(within_reach(arm, path))
    first = joints_holding_point(arm, path).position[:, 0]
    assert abs(first[0] - middle) <= np.pi + 1e-12
    assert np.abs(np.diff(first)).max() < np.pi


def test_the_base_may_be_above_the_pressing_point():
    """The elbow is on neither side of the base; the side towards the pin is used."""
    arm = PAPER.arm.model_copy(update={"base_x": -KEY.press_arm, "base_z": 0.114})
    still = Motion(np.zeros(3), np.zeros(3), np.zeros(3))
    joints, slide = joints_holding_normal(arm, KEY, still)
    assert np.isfinite(joints.velocity).all()
    assert slide == pytest.approx(0.12, abs=1e-12)


def by_complex_steps(arm, joints):
    """Return the fingertip's velocity and acceleration, by derivatives without differences."""
    step = 1e-30
    moved = joints.position + 1j * step * joints.velocity
    faster = joints.velocity + 1j * step * joints.acceleration
    velocity = fingertip_place(arm, moved).imag / step
    along = fingertip_motion(arm, Motion(moved, faster, joints.acceleration)).velocity
    return velocity, along.imag / step


@given(arms())
def test_joint_derivatives_holding_the_point_are_exact_by_complex_steps(arm):
    centre = along_the_key(arm, rocking(TIME))
    assume(min(margin.min() for margin in reach_margins(arm, centre.position)) > 1e-3)
    velocity, acceleration = by_complex_steps(arm, joints_holding_point(arm, centre))
    for found, expected in ((velocity, centre.velocity), (acceleration, centre.acceleration)):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@given(standing_arms())
def test_joint_derivatives_holding_the_normal_are_exact_by_complex_steps(arm):
    """The fingertip's motion by complex steps gives the planned motion of the key."""
    angle = rocking(TIME)
    try:
        joints, _ = joints_holding_normal(arm, KEY, angle)
    except TrajectoryError:
        assume(False)
    velocity, acceleration = by_complex_steps(arm, joints)
    place = fingertip_place(arm, joints.position)
    tangent, normal = surface_axes(angle.position)
    along, above = dot(place, tangent), KEY.surface_height + arm.fingertip_radius
    # C . n = H on the key, differentiated once and twice with t' = a' n and n' = -a' t.
    first = dot(velocity, normal) - angle.velocity * along
    second = (
        dot(acceleration, normal)
        - 2 * angle.velocity * dot(velocity, tangent)
        - angle.velocity**2 * above
        - angle.acceleration * along
    )
    np.testing.assert_allclose(first, 0, atol=1e-9 * np.abs(velocity).max())
    np.testing.assert_allclose(second, 0, atol=1e-9 * np.abs(acceleration).max())
    # Link 2 rotates with the key.
    for found, expected in zip(joints[1:], angle[1:], strict=True):
        np.testing.assert_allclose(found.sum(-1), expected, atol=1e-9 * np.abs(found).max())
