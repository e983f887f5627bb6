"""The elements against the elastica with shear, beam theory, and the extremes."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.elastica import Elastica
from sautereau.analysis.model.plectrum.fe.build import Solver
from sautereau.analysis.model.plectrum.fe.load import patch_at, section_at
from sautereau.analysis.model.plectrum.fe.profile import plectrum_grid, profile_of
from sautereau.analysis.model.plectrum.fe.solve import Body, solve_loads
from sautereau.rig.load import load_rig
from tests.outlines import outline_from

PLECTRUM = load_rig("paper").plectrum
SCALE = PLECTRUM.youngs_modulus * PLECTRUM.width * PLECTRUM.length
FORCES = np.array([0.1, 0.33, 0.5, 0.75, 1.0])


def with_shear(s, force):
    """Return x, z [m] and theta [rad] of the section of a shearing, stretching elastica.

    In a frame with the load along -z, from the loaded point inwards: alpha is the section's
    angle, and the load's normal is the surface's mean one there, which half the shear turns.
    """
    p = PLECTRUM
    area, nu = p.width * p.thickness, p.poisson_ratio
    shear_stiffness = (
        10 * (1 + nu) / (12 + 11 * nu) * area * p.youngs_modulus / (2 * (1 + nu))
    )  # Cowper

    def right(_, y):
        alpha, x, _ = y
        gamma = -force * np.cos(alpha) / shear_stiffness
        stretch = 1 - force * np.sin(alpha) / (p.youngs_modulus * area)
        return [
            force * x / p.bending_stiffness,
            stretch * np.cos(alpha) - gamma * np.sin(alpha),
            stretch * np.sin(alpha) + gamma * np.cos(alpha),
        ]

    start = force / shear_stiffness / 2
    end = solve_ivp(right, (0, s), [start, 0, 0], "DOP853", rtol=1e-12, atol=1e-15).y[:, -1]
    turn = -end[0]
    x = np.cos(turn) * end[1] - np.sin(turn) * end[2]
    z = np.sin(turn) * end[1] + np.cos(turn) * end[2]
    return np.array([x, z, start + turn])


def solved(count, layers, s, forces=FORCES, plectrum=PLECTRUM):
    """Return x, z [m], theta [rad] of the section and the load's direction, shape (4, n)."""
    length = plectrum.length
    scale = plectrum.youngs_modulus * plectrum.width * length
    profile = profile_of(plectrum)
    body = Body(plectrum_grid(profile, count, layers), plectrum.poisson_ratio)
    patch = patch_at(body.grid, s / length, profile.patch)
    section = section_at(body.grid, s / length)
    found = []
    for u in solve_loads(body, patch, forces / scale):
        x, z = section.displacement(u) * length
        found.append([s + x, z, section.rotation(u), patch.angle(u)])
    return np.array(found).T


def test_the_reference_is_the_elastica_but_for_shear():
    """Timoshenko's correction of a tip load: F L / kappa G A, 0.9 % of the bending."""
    bend = Elastica(PLECTRUM).bend(PLECTRUM.length, 0.1)
    _, z, theta = with_shear(PLECTRUM.length, 0.1)
    assert z / bend.z == pytest.approx(1.009, abs=5e-4)
    assert theta == pytest.approx(float(bend.theta), rel=1e-3)


@pytest.mark.parametrize("s", [4.1e-3, 4.25e-3, PLECTRUM.length])
def test_within_0_3_percent_of_the_elastica_with_shear(s):
    found = solved(60, 4, s)
    exact = np.array([with_shear(s, force) for force in FORCES]).T
    np.testing.assert_allclose(found[1], exact[1], rtol=3e-3)
    np.testing.assert_allclose(found[2], exact[2], rtol=3e-3)
    # The shortening decides release: of each to a hundredth, where rounding lets it.
    np.testing.assert_allclose(s - found[0], s - exact[0], rtol=1e-2)


def test_rotation_under_the_load_does_not_depend_on_the_mesh():
    for s in (4.25e-3, PLECTRUM.length):
        turned = [
            np.degrees(solved(*mesh, s, np.array([0.5, 1.0]))[2])
            for mesh in ((15, 2), (30, 4), (60, 6))
        ]
        assert np.ptp(turned, axis=0).max() < 0.1


def test_the_load_is_normal_to_the_section_but_for_half_the_shear():
    """At 1 N, 0.09 degrees: the string's direction and the section's are one in practice."""
    _, _, section, surface = solved(60, 4, 4.25e-3)
    nu, area = PLECTRUM.poisson_ratio, PLECTRUM.width * PLECTRUM.thickness
    stiffness = 10 / (12 + 11 * nu) * area * PLECTRUM.youngs_modulus / 2
    np.testing.assert_allclose(section - surface, FORCES / stiffness / 2, rtol=0.15)


def test_a_slender_tapered_plectrum_is_a_beam_of_varying_section():
    length, h0 = PLECTRUM.length, 0.02 * PLECTRUM.length
    outline = outline_from(lambda x: h0 * (1 - 0.6 * x / length), length)
    slender = PLECTRUM.model_copy(update={"outline": outline, "thickness": h0})
    s, force = 0.95 * length, 1e-8
    x = np.linspace(0, s, 20001)
    stiffness = (
        PLECTRUM.youngs_modulus
        * PLECTRUM.width
        * np.interp(x, outline.x, 2 * np.array(outline.top)) ** 3
    )
    curvature = 12 * force * (s - x) / stiffness
    _, z, theta, _ = solved(60, 2, s, np.array([force]), slender)[:, 0]
    assert -z == pytest.approx(np.trapezoid(curvature * (s - x), x), rel=2e-3)
    assert -theta == pytest.approx(np.trapezoid(curvature, x), rel=2e-3)


def test_a_flat_bottom_bends_as_a_flat_top_does_when_little():
    """For small loads only the thickness counts, not on which side it was carved."""
    turned = []
    for share in (0.0, 1.0):
        outline = outline_from(lambda x: 0.1e-3 * (1 - 0.5 * x / 4.5e-3), 4.5e-3)
        shift = (0.05e-3 - np.array(outline.top)) * (1 - 2 * share)
        moved = outline.model_copy(
            update={
                "top": tuple((np.array(outline.top) + shift).tolist()),
                "bottom": tuple((np.array(outline.bottom) + shift).tolist()),
            }
        )
        carved = PLECTRUM.model_copy(update={"outline": moved})
        turned.append(solved(40, 2, 4.3e-3, np.array([1e-5]), carved)[2, 0])
    assert turned[0] == pytest.approx(turned[1], rel=3e-3)


@pytest.mark.parametrize("friction", [0.1, 0.5])
def test_friction_bends_more_and_acts_on_the_top(friction):
    """A small load: the moment F s grows by mu F h / 2 all along, as on a beam."""
    profile = profile_of(PLECTRUM)
    plain, rough = (
        Solver(profile, PLECTRUM.poisson_ratio, mu).contact(1.0, np.array([1e-4]))
        for mu in (0.0, friction)
    )
    ratio = rough[2, 0] / plain[2, 0]
    lever = friction * PLECTRUM.thickness / PLECTRUM.length  # mu h/2 L over L^2 / 2
    assert ratio == pytest.approx(1 + lever, rel=3e-3)


@pytest.mark.parametrize("modulus", [1e6, 1e12])
def test_modulus_only_scales_the_load(modulus):
    other = PLECTRUM.model_copy(update={"youngs_modulus": modulus})
    forces = FORCES * modulus / PLECTRUM.youngs_modulus
    found = solved(20, 2, 4.3e-3, forces, other)
    np.testing.assert_allclose(found, solved(20, 2, 4.3e-3), rtol=1e-7)


@pytest.mark.parametrize("thickness", [0.05e-3, 0.2e-3, 1e-3])
@pytest.mark.parametrize("length", [2e-3, 4.5e-3, 9e-3])
def test_extremes_of_thickness_converge_up_to_their_limit(thickness, length):
    other = PLECTRUM.model_copy(update={"thickness": thickness, "length": length})
    solver = Solver(profile_of(other), other.poisson_ratio, 0.2)
    loads = np.linspace(0.1, 1, 6) * solver.limit
    x, z, turned = solver.contact(1.0, loads)
    assert np.all(np.diff(z) < 0)
    assert np.all(np.diff(x) < 0)
    assert -turned[-1] == pytest.approx(solver.limit / 2, rel=0.25)


def test_a_load_beyond_all_bounds_is_refused():
    body = Body(plectrum_grid(profile_of(PLECTRUM), 10, 2), 0.35)
    patch = patch_at(body.grid, 1.0, 0.03)
    with pytest.raises(ModelError, match="no equilibrium past a load of"):
        solve_loads(body, patch, [1.0])


def test_the_load_limit_turns_a_uniform_plectrum_as_its_docstring_says():
    solver = Solver(profile_of(PLECTRUM), PLECTRUM.poisson_ratio, 0.0)
    turned = np.degrees(solver.contact(1.0, np.array([1.0, 2.0]))[2])
    assert turned[-1] == pytest.approx(-56, abs=1.5)
    force = brentq(lambda f: Elastica(PLECTRUM).bend(4.5e-3, f).theta + np.radians(56), 1, 3)
    assert solver.load * SCALE * 2.0 == pytest.approx(force, rel=0.02)
