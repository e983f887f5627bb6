"""The finger's force against closed forms and the energy of key and jack."""

import numpy as np
import pytest
from scipy.integrate import trapezoid

from sautereau.analysis.model.key import finger_force, jack_load
from sautereau.rig.load import with_values
from sautereau.rig.section import GRAVITY
from sautereau.trajectory.key import jack_motion, key_motion, rise_of_angle
from sautereau.trajectory.motion import Motion


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


def test_statics_at_rest_is_the_weight_through_the_lever(paper):
    """F a_p = m g b - front heaviness; nothing rubs that does not move."""
    found = finger_force(paper, still(0.0), np.zeros(1))
    weight = paper.jack.mass * GRAVITY * paper.key.jack_arm - paper.key.gravity_moment
    assert found[0] == pytest.approx(weight / paper.key.press_arm, rel=1e-12)
    assert found[0] / GRAVITY == pytest.approx(0.005, abs=0.003)


def test_statics_of_a_held_string_at_any_angle(paper):
    """With the rise b tan a + hb (1 / cos a - 1): F a_p = (m g + F_s)(b + hb sin a) / cos^2 a."""
    paper = with_values(paper, {"key.dip": "1 m"})  # the felt out of the way
    angle = np.radians([0.0, 1.0, 3.0])
    key = paper.key
    found = finger_force(paper, still(angle), np.full(3, 0.5))
    lever = (key.jack_arm + key.jack_surface_height * np.sin(angle)) / np.cos(angle) ** 2
    moment = (paper.jack.mass * GRAVITY + 0.5) * lever - key.gravity_moment
    np.testing.assert_allclose(found, moment / key.press_arm, rtol=1e-12)


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


def test_the_jack_leaves_the_key_when_the_key_falls_faster(paper):
    falling = np.array([-1.01, -0.99]) * GRAVITY
    load = jack_load(paper.jack, np.zeros(2), falling, np.zeros(2))
    assert load[0] < 0 < load[1]


def test_the_fingers_work_is_energy_and_heat(paper):
    """Over any smooth motion, the power of every force is in the balance."""
    key, jack = paper.key, paper.jack
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
        rise = jack_motion(key, angle)
        work = trapezoid(force * key.press_arm * angle.velocity, time)
        heat = trapezoid(
            key.pivot_viscous_friction * angle.velocity**2
            + key.pivot_coulomb_friction * np.abs(angle.velocity)
            + jack.register_friction * np.abs(rise.velocity)
            + string * rise.velocity,
            time,
        )
        kinetic = key.inertia * angle.velocity**2 / 2 + jack.mass * rise.velocity**2 / 2
        potential = (
            jack.mass * GRAVITY * rise_of_angle(key, angle.position)
            - key.gravity_moment * angle.position
        )
        errors.append(work - heat - np.ptp((kinetic + potential)[[0, -1]]))
    orders = np.log2(np.abs(np.divide(errors[:-1], errors[1:])))
    np.testing.assert_allclose(orders, 2, atol=0.1)
    assert abs(errors[-1]) < 1e-6 * work


def test_inertia_of_key_and_jack_at_the_pressing_point(smooth):
    """From rest at angle 0: F a_p = (I + m b^2) a'' + weight, the curvature having no speed."""
    key, jack = smooth.key, smooth.jack
    rise = Motion(np.zeros(1), np.zeros(1), np.array([12.0]))
    angle = key_motion(key, rise)
    found = finger_force(smooth, angle, np.zeros(1)) - finger_force(smooth, still(0.0), np.zeros(1))
    inertia = key.inertia + jack.mass * key.jack_arm**2
    assert found[0] == pytest.approx(inertia * 12.0 / key.jack_arm / key.press_arm, rel=1e-12)


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
