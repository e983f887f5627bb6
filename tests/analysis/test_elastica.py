"""The exact plectrum against its closed forms and an independent boundary-value solve."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root
from scipy.special import beta

from sautereau.analysis.model.plectrum.elastica import Q_MAX, Elastica
from sautereau.analysis.model.plectrum.shape import POINTS, mid_line
from sautereau.rig.load import load_rig

PLECTRUM = load_rig("paper").plectrum
EI = PLECTRUM.bending_stiffness


@pytest.fixture(scope="module")
def elastica():
    return Elastica(PLECTRUM)


def rubbed(friction):
    return Elastica(PLECTRUM.model_copy(update={"friction": friction}))


def shoot(s, force, friction=0.0):
    """Return x, z, theta of the load's moments balanced in the clamp's frame.

    The load is normal to the loaded end and, by friction, along it. In arc length from
    the clamp, opposite to the table's direction; all in units of s.
    """
    q = force * s**2 / EI

    def along(unknown):
        bend, tip = unknown
        load_x = q * (np.sin(tip) + friction * np.cos(tip))
        load_z = q * (friction * np.sin(tip) - np.cos(tip))

        def right(_, y):
            cos, sin = np.cos(y[0]), np.sin(y[0])
            return [y[1], load_x * sin - load_z * cos, cos, sin]

        return solve_ivp(right, (0, 1), [0, bend, 0, 0], "DOP853", rtol=1e-13, atol=1e-15).y[:, -1]

    def residual(unknown):
        end = along(unknown)
        return [end[0] - unknown[1], end[1]]

    found = root(residual, [-q * 0.9, -q / 2 * 0.9], tol=1e-13)
    end = along(found.x)
    assert np.abs(residual(found.x)).max() < 1e-11
    return end[2], end[3], end[0]


@pytest.mark.parametrize(
    ("force", "z", "shift", "degrees"),
    [(0.33, 0.4979, -0.033, 9.5), (0.5, 0.7501, -0.076, 14.4), (1.0, 1.4565, -0.295, 28.7)],
)
def test_reference_values(elastica, force, z, shift, degrees):
    """To all the digits that they are printed with."""
    bend = elastica.bend(PLECTRUM.length, force)
    assert -bend.z * 1e3 == pytest.approx(z, rel=1e-4)
    assert (bend.x - PLECTRUM.length) * 1e3 == pytest.approx(shift, abs=0.5e-3)
    assert -np.degrees(bend.theta) == pytest.approx(degrees, abs=0.05)


@pytest.mark.parametrize("friction", [0.0, 1e-6, 0.1, 0.2, 0.35, 0.5])
def test_an_independent_solve_agrees(friction):
    elastica = rubbed(friction)
    for place, share in ((1.0, 0.02), (0.9, 0.4), (0.3, 0.75), (1.0, 1.0)):
        s = place * PLECTRUM.length
        force = share * float(elastica.force_limit(s))
        bend = elastica.bend(s, force)
        found = (bend.x / s, bend.z / s, bend.theta)
        np.testing.assert_allclose(found, shoot(s, force, friction), rtol=1e-9, atol=1e-10)


def test_the_limit_is_just_short_of_ninety_degrees(elastica):
    s = np.array([1e-4, PLECTRUM.length])
    theta = np.degrees(elastica.bend(s, elastica.force_limit(s)).theta)
    np.testing.assert_allclose(theta, -90, atol=0.2)
    assert np.all(theta > -90)
    # psi'^2 = 2 sin psi, so that xi at 90 degrees is a quarter of a beta function.
    right_angle = (beta(0.25, 0.5) / np.sqrt(8)) ** 2
    assert right_angle == pytest.approx(3.4376, abs=1e-4)
    assert 0.997 * right_angle < Q_MAX < right_angle


def test_the_equations_hold_just_beyond_the_tip(elastica):
    """As far as a search for the release may ask."""
    s = 1.01 * PLECTRUM.length
    force = float(elastica.force_limit(PLECTRUM.length))
    assert elastica.force_limit(s) == force
    bend = elastica.bend(s, force)
    found = (bend.x / s, bend.z / s, bend.theta)
    np.testing.assert_allclose(found, shoot(s, force), rtol=1e-7)


# The complete mid-line.


def arc(line):
    return np.concatenate([[0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("force", [0.1, 0.5, 1.5])
def test_the_mid_line_solves_the_equation(force, friction):
    """The equation is integrated from the clamp, with the end's angle and place given."""
    plectrum = rubbed(friction)
    s = 4.3e-3
    line = mid_line(plectrum, np.array([s]), np.array([force]))[0]
    end = plectrum.bend(s, force)
    # The load, normal to the surface at the string and along it towards the tip.
    angle = float(end.theta)
    load = force * np.array([np.sin(angle), -np.cos(angle)])
    load += friction * force * np.array([np.cos(angle), np.sin(angle)])
    place = np.array([float(end.x), float(end.z)])

    def right(_, state):
        x, z, theta = state
        lever = place - (x, z)
        moment = lever[0] * load[1] - lever[1] * load[0]
        return [np.cos(theta), np.sin(theta), moment / EI]

    at = np.linspace(0, s, POINTS)
    found = solve_ivp(right, (0, s), [0, 0, 0], t_eval=at, rtol=1e-11, atol=1e-16).y[:2].T
    np.testing.assert_allclose(line[:POINTS], found, atol=1e-10)
