"""The key's geometry, there and back, and its derivatives against differences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.rig.load import load_rig
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.key import (
    angle_of_rise,
    jack_motion,
    key_motion,
    key_under_fingertip,
    point_on_key,
    rise_curvature,
    rise_of_angle,
    rise_slope,
    surface_axes,
)
from sautereau.trajectory.motion import Motion, cross, dot
from tests.trajectory.brute_force import close, derivatives

PAPER = load_rig().key
ANGLES = np.radians(np.linspace(-30, 30, 241))


@st.composite
def keys(draw):
    return PAPER.model_copy(
        update={
            "press_arm": draw(st.floats(0.08, 0.3)),
            "jack_arm": draw(st.floats(0.1, 0.5)),
            "surface_height": draw(st.floats(0, 0.03)),
            "jack_surface_height": draw(st.floats(0, 0.03)),
        }
    )


def rocking(t):
    """A smooth angle of a key, with derivatives written out."""
    return Motion(0.05 * np.sin(9 * t), 0.45 * np.cos(9 * t), -4.05 * np.sin(9 * t))


def test_a_rise_of_10_mm_needs_a_dip_of_7_95_mm():
    angle = angle_of_rise(PAPER, 0.01)
    front = point_on_key(Motion(angle, angle, angle), -PAPER.press_arm, PAPER.surface_height)
    assert PAPER.surface_height - front.position[1] == pytest.approx(7.95e-3, abs=5e-6)


@given(keys())
def test_angle_and_rise_are_inverse(key):
    rise = rise_of_angle(key, ANGLES)
    assert np.abs(angle_of_rise(key, rise) - ANGLES).max() < 1e-12
    assert np.abs(rise_of_angle(key, angle_of_rise(key, rise)) - rise).max() < 1e-12


def test_small_rises_keep_their_digits():
    rise = np.logspace(-15, -3, 49)
    assert rise_of_angle(PAPER, angle_of_rise(PAPER, rise)) == pytest.approx(rise, rel=1e-12)


@given(keys())
def test_slope_and_curvature_are_derivatives(key):
    first, second = derivatives(lambda a: rise_of_angle(key, a), ANGLES, 0.01)
    close(rise_slope(key, ANGLES), first, 1e-9)
    close(rise_curvature(key, ANGLES), second, 1e-9)


@given(keys())
def test_key_motion_is_the_time_derivative(key):
    t = np.linspace(0, 1, 101)

    def rise(t):
        return 0.01 * np.sin(3 * t)

    motion = key_motion(key, Motion(rise(t), 0.03 * np.cos(3 * t), -0.09 * np.sin(3 * t)))
    first, second = derivatives(lambda t: angle_of_rise(key, rise(t)), t, 0.02)
    close(motion.velocity, first, 1e-9)
    close(motion.acceleration, second, 1e-9)
    back = jack_motion(key, motion)
    close(back.position, rise(t), 1e-12)
    close(back.velocity, 0.03 * np.cos(3 * t), 1e-12)
    close(back.acceleration, -0.09 * np.sin(3 * t), 1e-12)


def test_axes_are_orthonormal_and_right_handed():
    tangent, normal = surface_axes(ANGLES)
    assert np.abs(dot(tangent, normal)).max() < 1e-16
    assert np.abs(cross(tangent, normal) - 1).max() < 1e-15


def test_a_point_moves_as_its_position_says():
    t = np.linspace(0, 1, 101)
    point = point_on_key(rocking(t), -0.17, 0.014)
    first, second = derivatives(lambda t: point_on_key(rocking(t), -0.17, 0.014).position, t, 0.01)
    close(point.velocity, first, 1e-9)
    close(point.acceleration, second, 1e-9)
    assert np.hypot(*point.position.T) == pytest.approx(np.hypot(0.17, 0.014), rel=1e-15)


def test_the_key_under_any_path_of_a_fingertip():
    """The fingertip may slide, which `point_on_key` does not."""
    t = np.linspace(0, 1, 101)

    def path(t):
        return np.stack([-0.17 + 0.01 * np.sin(4 * t), 0.014 - 0.005 * np.sin(3 * t)], -1)

    velocity = np.stack([0.04 * np.cos(4 * t), -0.015 * np.cos(3 * t)], -1)
    acceleration = np.stack([-0.16 * np.sin(4 * t), 0.045 * np.sin(3 * t)], -1)
    still = np.zeros((len(t), 2))
    found = key_under_fingertip(PAPER, 0.004, Motion(path(t), velocity, acceleration))
    first, second = derivatives(
        lambda t: key_under_fingertip(PAPER, 0.004, Motion(path(t), still, still)).position, t, 0.02
    )
    close(found.velocity, first, 1e-9)
    close(found.acceleration, second, 1e-9)
    _, normal = surface_axes(found.position)
    assert dot(path(t), normal) == pytest.approx(PAPER.surface_height + 0.004, rel=1e-13)


def test_a_fingertip_at_the_pin_touches_at_no_angle():
    still = np.zeros((1, 2))
    with pytest.raises(TrajectoryError, match=r"within 14 mm of the balance pin.*press_arm"):
        key_under_fingertip(PAPER, 0.004, Motion(np.array([[-0.01, 0.005]]), still, still))


def test_rise_and_slope_are_the_textbook_law_up_to_steep_angles():
    key = PAPER.model_copy(update={"jack_surface_height": 0.01})
    angle = np.linspace(-1.4, 1.4, 57)
    b, hb = key.jack_arm, key.jack_surface_height
    rise = b * np.tan(angle) + hb * (1 / np.cos(angle) - 1)
    slope = (b + hb * np.sin(angle)) / np.cos(angle) ** 2
    np.testing.assert_allclose(rise_of_angle(key, angle), rise, rtol=1e-12, atol=1e-17)
    np.testing.assert_allclose(rise_slope(key, angle), slope, rtol=1e-12)
