"""The elements against the elastica with shear, beam theory, and the extremes."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.fe.build import Solver, build
from sautereau.analysis.model.plectrum.fe.mesh import patch_at, plectrum_grid, section_at
from sautereau.analysis.model.plectrum.fe.solve import Body, Elastic, solve_loads
from sautereau.analysis.model.plectrum.levels import level_of, plectrum_map
from sautereau.analysis.model.plectrum.profile import profile_of
from sautereau.analysis.model.predict import predict
from sautereau.rig.instrument import Plectrum
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
    body = Body(plectrum_grid(profile, count, layers), Elastic(plectrum.poisson_ratio))
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
    solver = Solver(profile_of(PLECTRUM), Elastic(PLECTRUM.poisson_ratio))
    plain, rough = solver.laws(np.ones(1), np.array([1e-4]), np.array([0.0, friction]))[2, :, 0]
    ratio = rough / plain
    lever = friction * PLECTRUM.thickness / PLECTRUM.length  # mu h/2 L over L^2 / 2
    assert ratio == pytest.approx(1 + lever, rel=3e-3)


@pytest.mark.parametrize(
    ("thickness", "length"),
    [
        (0.5e-3, 1.5e-3),
        *(
            pytest.param(*s, marks=pytest.mark.slow)
            for s in [(5e-5, 9e-3), (2e-4, 4.5e-3), (1e-3, 2e-3)]
        ),
    ],
)
def test_extremes_of_thickness_converge_up_to_their_limit(thickness, length):
    """A stub has no equilibrium under the loads that turn a longer one by 56 degrees."""
    other = PLECTRUM.model_copy(update={"thickness": thickness, "length": length})
    profile, material = profile_of(other), Elastic(other.poisson_ratio)
    table, _ = build(profile, material, 0.7)
    loads = np.linspace(0.1, 1, 6) * table.q_max
    x, z, turned = Solver(profile, material).laws(np.ones(1), loads, np.array([0.2]))[:, 0, :, 0]
    assert np.all(np.diff(z * loads) < 0)
    assert np.all(np.diff(x) < 0)
    assert -turned[-1] == pytest.approx(1 / 2, rel=0.25)


def test_a_load_beyond_all_bounds_is_refused():
    body = Body(plectrum_grid(profile_of(PLECTRUM), 10, 2), Elastic(0.35))
    patch = patch_at(body.grid, 1.0, 0.03)
    with pytest.raises(ModelError, match="no equilibrium past a load of"):
        solve_loads(body, patch, [1.0])


QUILL = Elastic(0.35, across=0.4, shear=0.06)


@pytest.mark.parametrize("material", [Elastic(0.3), QUILL])
def test_the_stiffness_is_the_inverse_of_the_compliance(material):
    """Of a plane stress: [[1, -nu, 0], [-nu, E_1 / E_2, 0], [0, 0, E_1 / G]]."""
    nu = material.poisson_ratio
    shear = material.shear or 1 / (2 * (1 + nu))
    compliance = [[1, -nu, 0], [-nu, 1 / material.across, 0], [0, 0, 1 / shear]]
    np.testing.assert_allclose(material.stiffness @ compliance, np.eye(3), atol=1e-14)


@pytest.mark.parametrize("shear", [0.02, 0.06, 0.2])
def test_a_soft_shear_modulus_adds_its_deflection(shear):
    """F s^3 / 3EI + F s / (kappa G A) by Timoshenko, kappa = 5/6, of which it is 2 to 15 %."""
    profile = profile_of(PLECTRUM)
    solver = Solver(profile, QUILL._replace(shear=shear))
    found = float(solver.laws(np.ones(1), np.array([1e-4]), np.zeros(1))[1, 0, 0, 0])
    expected = 1 / 3 + profile.clamp_thickness**2 / 12 * 6 / 5 / shear
    assert -found == pytest.approx(expected, rel=4e-3)


def test_age_softens_every_level_alike():
    aged = PLECTRUM.model_copy(update={"ageing": 0.8})
    softer = PLECTRUM.model_copy(update={"youngs_modulus": 0.8 * PLECTRUM.youngs_modulus})
    for level in ("elastica", "fe", "rods", "beam"):
        one, other = (plectrum_map(p, level).bend(4.2e-3, 0.4) for p in (aged, softer))
        np.testing.assert_allclose(one, other, rtol=1e-12)


def test_a_quill_is_computed_by_elements_and_others_say_what_they_ignore():
    quill = PLECTRUM.model_copy(update={"shear_modulus": 0.06 * PLECTRUM.youngs_modulus})
    rig = load_rig().model_copy(update={"plectrum": quill})
    assert level_of(quill) == "fe"
    for level in ("elastica", "beam"):
        (warning,) = predict(rig, level).warnings
        assert f"{level} ignores plectrum.shear_modulus" in warning
    # Its shear adds 6 % to a small deflection, where that of an isotropic one adds 0.7 %.
    soft, plain = (plectrum_map(p, "fe").bend(4.2e-3, 0.2).z for p in (quill, PLECTRUM))
    assert 1.04 < soft / plain < 1.08
    with pytest.raises(ValueError, match="no stable material"):
        Plectrum.model_validate(
            {
                **{"length": "4.5 mm", "width": "0.75 mm", "thickness": "0.48 mm"},
                **{"youngs_modulus": "1 GPa", "transverse_modulus": "9 GPa", "poisson_ratio": 0.4},
                **{"density": "1247 kg/m^3", "overlap": "0.3 mm"},
            }
        )
