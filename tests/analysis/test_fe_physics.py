"""The elements against the elastica with shear, beam theory, and the extremes."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.fe.build import Solver
from sautereau.analysis.model.plectrum.fe.load import patch_at, section_at
from sautereau.analysis.model.plectrum.fe.mesh import plectrum_grid
from sautereau.analysis.model.plectrum.fe.solve import Body, solve_loads
from sautereau.analysis.model.plectrum.profile import profile_of
from sautereau.rig.load import load_rig
from tests.outlines import outline_from

PLECTRUM = load_rig("paper").plectrum
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
    """Return x, z [m] and theta [rad] of the section, shape (3, n)."""
    length = plectrum.length
    scale = plectrum.youngs_modulus * plectrum.width * length
    profile = profile_of(plectrum)
    body = Body(plectrum_grid(profile, count, layers), plectrum.poisson_ratio)
    patch = patch_at(body.grid, s / length, profile.patch)
    section = section_at(body.grid, s / length)
    found = []
    for u in solve_loads(body, patch, forces / scale):
        x, z = section.displacement(u) * length
        found.append([s + x, z, section.rotation(u)])
    return np.array(found).T


@pytest.mark.parametrize("s", [4.1e-3, 4.25e-3, PLECTRUM.length])
def test_within_0_3_percent_of_the_elastica_with_shear(s):
    found = solved(60, 4, s)
    exact = np.array([with_shear(s, force) for force in FORCES]).T
    np.testing.assert_allclose(found[1], exact[1], rtol=3e-3)
    np.testing.assert_allclose(found[2], exact[2], rtol=3e-3)
    # The shortening decides release: of each to a hundredth, where rounding lets it.
    np.testing.assert_allclose(s - found[0], s - exact[0], rtol=1e-2)


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
    _, z, theta = solved(60, 2, s, np.array([force]), slender)[:, 0]
    assert -z == pytest.approx(np.trapezoid(curvature * (s - x), x), rel=2e-3)
    assert -theta == pytest.approx(np.trapezoid(curvature, x), rel=2e-3)


@pytest.mark.parametrize("friction", [0.1, 0.5])
def test_friction_bends_more_and_acts_on_the_top(friction):
    """A small load: the moment F s grows by mu F h / 2 all along, as on a beam."""
    solver = Solver(profile_of(PLECTRUM), PLECTRUM.poisson_ratio)
    plain, rough = solver.laws(np.ones(1), np.array([1e-4]), np.array([0.0, friction]))[2, :, 0]
    ratio = rough / plain
    lever = friction * PLECTRUM.thickness / PLECTRUM.length  # mu h/2 L over L^2 / 2
    assert ratio == pytest.approx(1 + lever, rel=3e-3)


@pytest.mark.parametrize(("thickness", "length"), [(0.05e-3, 9e-3), (0.2e-3, 4.5e-3), (1e-3, 2e-3)])
def test_extremes_of_thickness_converge_up_to_their_limit(thickness, length):
    other = PLECTRUM.model_copy(update={"thickness": thickness, "length": length})
    solver = Solver(profile_of(other), other.poisson_ratio)
    loads = np.linspace(0.1, 1, 6) * solver.limit
    x, z, turned = solver.laws(np.ones(1), loads, np.array([0.2]))[:, 0, :, 0]
    assert np.all(np.diff(z * loads) < 0)
    assert np.all(np.diff(x) < 0)
    assert -turned[-1] == pytest.approx(1 / 2, rel=0.25)


def test_a_load_beyond_all_bounds_is_refused():
    body = Body(plectrum_grid(profile_of(PLECTRUM), 10, 2), 0.35)
    patch = patch_at(body.grid, 1.0, 0.03)
    with pytest.raises(ModelError, match="no equilibrium past a load of"):
        solve_loads(body, patch, [1.0])
