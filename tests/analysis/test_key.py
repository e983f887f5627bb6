"""The finger's force against closed forms and the energy of key and jack."""

import numpy as np
import pytest
from scipy.integrate import trapezoid

from sautereau.analysis.model.key import finger_force, jack_load
from sautereau.rig.load import with_values
from sautereau.rig.units import GRAVITY
from sautereau.trajectory.key import key_motion
from sautereau.trajectory.motion import Motion
from tests.key_oracle import dissipated_power, energy, slope, static_moment


@pytest.fixture
def smooth(paper):
    return with_values(
        paper,
        {
            "key.pivot_coulomb_friction": "0 N m",
            "key.pivot_viscous_friction": "0 N m s/rad",
            "jack.register_friction": "0 N",
        },
    )


def still(rise):
    rise = np.atleast_1d(np.asarray(rise, float))
    return Motion(rise, np.zeros_like(rise), np.zeros_like(rise))


def test_friction_works_against_the_motion(paper, smooth):
    """Up and down differ by twice the dry friction, and by the viscous one."""
    key, jack = paper.key, paper.jack
    up, down = (Motion(np.zeros(1), np.array([v]), np.zeros(1)) for v in (0.4, -0.4))
    bare = finger_force(smooth, up, np.zeros(1))
    rubbing = finger_force(paper, up, np.zeros(1)) - bare
    dry = key.pivot_coulomb_friction + jack.register_friction * key.jack_arm
    expected = (dry + key.pivot_viscous_friction * 0.4) / key.press_arm
    assert rubbing[0] == pytest.approx(expected, rel=1e-9)
    assert finger_force(paper, down, np.zeros(1)) - bare == pytest.approx(-rubbing, rel=1e-9)


@pytest.mark.parametrize("speed", [0.1, -0.1])
def test_friction_of_the_fingertip_changes_its_lever_by_the_height_of_the_surface(paper, speed):
    """F (a_p + mu h) downwards, F (a_p - mu h) upwards."""
    rough = paper.replaced({"arm.fingertip_friction": 0.3})
    motion = Motion(*(np.array([value]) for value in (0.01, speed, 0.0)))
    smooth, rubbed = (finger_force(rig, motion, np.array([0.5])) for rig in (paper, rough))
    lever = paper.key.press_arm + np.sign(speed) * 0.3 * paper.key.surface_height
    assert rubbed * lever == pytest.approx(smooth * paper.key.press_arm, rel=1e-12)


def test_the_jack_leaves_the_key_when_the_key_falls_faster(paper):
    falling = np.array([-1.01, -0.99]) * GRAVITY
    load = jack_load(paper.jack, np.zeros(2), falling, np.zeros(2))
    assert load[0] < 0 < load[1]


def test_the_fingers_work_is_energy_and_heat(paper):
    """Over any smooth motion, the power of every force is in the balance."""
    key = paper.key
    errors = []
    for n in (500, 1000, 2000):
        time = np.linspace(0, 0.1, n)
        w = 2 * np.pi / 0.17
        angle = Motion(
            0.02 * (1 - np.cos(w * time)),
            0.02 * w * np.sin(w * time),
            0.02 * w**2 * np.cos(w * time),
        )
        string = 0.3 + 40 * angle.position
        force = finger_force(paper, angle, string)
        omega = angle.velocity
        work = trapezoid(force * key.press_arm * omega, time)
        heat = dissipated_power(paper, angle.position, omega)
        heat = trapezoid(heat + string * slope(key, angle.position) * omega, time)
        first, *_, last = energy(paper, angle.position, omega)
        errors.append(work - heat - (last - first))
    orders = np.log2(np.abs(np.divide(errors[:-1], errors[1:])))
    np.testing.assert_allclose(orders, 2, atol=0.1)
    assert abs(errors[-1]) < 1e-6 * work


def test_the_felt_adds_a_spring_and_a_damper_past_the_dip(paper):
    """Pushed slowly past its dip the key meets 20 kN/m; left fast, the felt never pulls."""
    arm, dip = paper.key.press_arm, paper.key.dip
    travel = dip + np.array([-1e-4, -1e-9, 1e-9, 1e-4, 1e-3])
    for speed in (0.0, 0.05, -5.0):
        angle = Motion(travel / arm, np.full(5, speed / arm), np.zeros(5))
        bare = with_values(paper, {"key.dip": "1 m"})
        nothing = np.zeros(5)
        felt = finger_force(paper, angle, nothing) - finger_force(bare, angle, nothing)
        pressed = np.maximum(travel - dip, 0)
        law = paper.key.felt_stiffness * pressed + paper.key.felt_damping * speed * (pressed > 0)
        np.testing.assert_allclose(felt, np.maximum(law, 0), rtol=1e-9, atol=1e-9)
        assert (felt >= 0).all()


def test_inertia_of_key_and_jack_at_the_pressing_point(smooth):
    """From rest at angle 0: F a_p = (I + m b^2) a'' + weight, the curvature having no speed."""
    key, jack = smooth.key, smooth.jack
    rise = Motion(np.zeros(1), np.zeros(1), np.array([12.0]))
    angle = key_motion(key, rise)
    found = finger_force(smooth, angle, np.zeros(1)) - finger_force(smooth, still(0.0), np.zeros(1))
    inertia = key.inertia + jack.mass * key.jack_arm**2
    assert found[0] == pytest.approx(inertia * 12.0 / key.jack_arm / key.press_arm, rel=1e-12)


def test_statics_at_rest_is_the_weight_through_the_lever(paper):
    """F a_p = m g b - M_g, the static gravity moment; without motion there is no friction."""
    found = finger_force(paper, still(0.0), np.zeros(1))
    assert found[0] == pytest.approx(static_moment(paper) / paper.key.press_arm, rel=1e-12)
    assert found[0] / GRAVITY == pytest.approx(0.005, abs=0.003)


def test_statics_of_a_held_string_at_any_angle(paper):
    """With the rise b tan a + hb (1 / cos a - 1): F a_p = (m g + F_s)(b + hb sin a) / cos^2 a."""
    paper = with_values(paper, {"key.dip": "1 m"})  # the felt out of the way
    angle = np.radians([0.0, 1.0, 3.0])
    key = paper.key
    found = finger_force(paper, still(angle), np.full(3, 0.5))
    moment = static_moment(paper, angle, string=0.5)
    np.testing.assert_allclose(found, moment / key.press_arm, rtol=1e-12)
