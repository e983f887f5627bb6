"""The exact plectrum against its closed forms and an independent boundary-value solve."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root
from scipy.special import beta

from sautereau.analysis.model.plectrum.elastica import Elastica, uniform_table
from sautereau.analysis.model.plectrum.table import laws_under
from sautereau.analysis.model.plectrum.tapered import bent
from sautereau.rig.load import load_rig

PLECTRUM = load_rig("paper").plectrum
EI = PLECTRUM.bending_stiffness


@pytest.fixture(scope="module")
def elastica():
    return Elastica(PLECTRUM)


def rubbed_plectrum(friction):
    return PLECTRUM.model_copy(update={"friction": friction})


def rubbed(friction):
    return Elastica(rubbed_plectrum(friction))


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


def test_the_limit_is_just_short_of_ninety_degrees():
    s = np.array([1e-4, PLECTRUM.length])
    for elastica in map(rubbed, (0.0, 0.1, 0.5)):
        theta = np.degrees(elastica.bend(s, elastica.force_limit(s)).theta)
        np.testing.assert_allclose(theta, -90, atol=0.2)
        assert np.all(theta > -90)
    # psi'^2 = 2 sin psi, so that xi at 90 degrees is a quarter of a beta function.
    right_angle = (beta(0.25, 0.5) / np.sqrt(8)) ** 2
    assert right_angle == pytest.approx(3.4376, abs=1e-4)
    assert 0.997 * right_angle < uniform_table().limit(0.0) < right_angle


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
    edges = bent(rubbed_plectrum(friction), *np.array([[s], [force], [friction]]))[0]
    line = (edges[: len(edges) // 2] + edges[: len(edges) // 2 - 1 : -1]) / 2
    points = len(line) - 1
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

    at = np.linspace(0, s, points)
    found = solve_ivp(right, (0, s), [0, 0, 0], t_eval=at, rtol=1e-11, atol=1e-16).y[:2].T
    np.testing.assert_allclose(line[:points], found, atol=1e-10)


def strain_energy(s, force, friction):
    """Return EI / 2 times the integral of the curvature squared [J], from the ODE itself."""
    xi = s * np.sqrt(force / EI)
    bent = solve_ivp(
        lambda _, y: [y[1], np.cos(y[0]) + friction * np.sin(y[0]), y[1] ** 2],
        (0, xi),
        [0, 0, 0],
        "DOP853",
        rtol=1e-12,
        atol=1e-15,
    )
    return np.sqrt(force * EI) / 2 * bent.y[2, -1]


def test_energy_of_the_bending(elastica):
    """A load that grows from nothing at one place: its work is EI / 2 int curvature^2."""
    for friction, s in ((0.0, 4.5e-3), (0.0, 2e-3), (0.2, 4.5e-3), (0.5, 3e-3)):
        plectrum = rubbed(friction)
        end = 0.95 * float(plectrum.force_limit(s))
        node, weight = np.polynomial.legendre.leggauss(40)
        force, weight = end * (node + 1) / 2, end * weight / 2
        b = plectrum.bend(s, force)
        across = np.sin(b.theta) * b.x_f - np.cos(b.theta) * b.z_f
        along = np.cos(b.theta) * b.x_f + np.sin(b.theta) * b.z_f
        work = weight @ (force * (across + friction * along))
        assert work == pytest.approx(strain_energy(s, end, friction), rel=1e-9)


def test_stiffness_scales_the_force_alone():
    """The table has one variable: E times 10 and F times 10 is the same shape."""
    stiffer = PLECTRUM.model_copy(update={"youngs_modulus": PLECTRUM.youngs_modulus * 10})
    one, ten = Elastica(PLECTRUM).bend(4e-3, 0.7), Elastica(stiffer).bend(4e-3, 7.0)
    np.testing.assert_allclose(one[:6], ten[:6], rtol=1e-12)
    np.testing.assert_allclose(one[6:], np.multiply(ten[6:], 10), rtol=1e-12)


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.2, 0.5])
def test_the_table_has_converged(friction):
    """The last coefficients of its polynomials hardly matter, and cells join smoothly."""
    table, slopes = laws_under(uniform_table(), friction)
    width = table.x[1]
    assert np.abs(table.c[0] * width**5).max() < 1e-9
    for law, rounding in ((table, 1e-14), (slopes, 2e-11)):
        ends = (law.c * width ** np.arange(len(law.c) - 1, -1, -1)[:, *(4 * [None])]).sum(axis=0)
        np.testing.assert_allclose(ends[:-1], law(law.x[1:-1]), atol=rounding)
