"""The elements themselves: patch, rate, tangent, energy, scikit-fem's own forms, mirror."""

import numpy as np
import pytest
from scipy.sparse import dia_array
from scipy.spatial import cKDTree
from skfem import Basis, BilinearForm, ElementQuad2, ElementVector, LinearForm, MeshQuad
from skfem.helpers import ddot, grad, transpose

from sautereau.analysis.model.plectrum.fe.load import patch_at, section_at
from sautereau.analysis.model.plectrum.fe.profile import Profile, plectrum_grid
from sautereau.analysis.model.plectrum.fe.solve import Body, iterates, rate, solve_loads

NU = 0.35
CARVED = Profile(
    np.array([0.0, 0.4, 1.0]), np.array([0.06, 0.05, 0.02]), np.array([-0.06, -0.05, -0.04])
)
"""Neither even about its mid-line nor of one slope."""
LOAD = 1.5e-4
"""E W L, which turns `CARVED` by half a radian."""


@pytest.fixture(scope="module")
def body():
    return Body(plectrum_grid(CARVED, 20, 2), NU)


@pytest.fixture(scope="module")
def patch(body):
    return patch_at(body.grid, 0.9, CARVED.patch, friction=0.1)


@pytest.fixture(scope="module")
def bent(body, patch):
    return solve_loads(body, patch, [LOAD])[0]


def dense(body, band):
    offsets = np.arange(body.band, -body.band - 1, -1)
    return dia_array((band, offsets), shape=(body.size, body.size)).toarray()


def identity(like):
    return np.eye(2)[:, :, None, None] + 0 * like


def test_forces_and_tangent_are_those_of_scikit_fem(body, bent):
    """The same weak form, written as the formula and assembled by the library."""
    grid = body.grid
    corners, index = np.unique(grid.cells[:, :4], return_inverse=True)
    mesh = MeshQuad(grid.nodes[corners].T.copy(), index.reshape(-1, 4).T.copy())
    basis = Basis(mesh, ElementVector(ElementQuad2()), intorder=5)
    _, node = cKDTree(grid.nodes).query(basis.doflocs.T)
    ours = 2 * node
    for dof, component in enumerate(_components(basis)):
        ours[dof] += component
    u = basis.interpolate(bent[ours])

    def stress(strain):
        trace = strain[0, 0] + strain[1, 1]
        plain = (1 - NU) * strain + NU * trace * identity(strain)
        return plain / (1 - NU**2)

    def green(w):
        slope = grad(w["u"])
        return (slope + transpose(slope) + _mul(transpose(slope), slope)) / 2

    def varied(w, v):
        product = _mul(transpose(grad(v)), identity(grad(v)) + grad(w["u"]))
        return (product + transpose(product)) / 2

    @LinearForm
    def internal(v, w):
        return ddot(stress(green(w)), varied(w, v))

    @BilinearForm
    def tangent(u, v, w):
        curved = _mul(transpose(grad(u)), grad(v))
        return ddot(stress(varied(w, u)), varied(w, v)) + ddot(stress(green(w)), curved)

    forces, band = body.linearised(bent)
    found = internal.assemble(basis, u=u)
    np.testing.assert_allclose(forces[ours], found, atol=1e-14)
    expected = tangent.assemble(basis, u=u).toarray()
    np.testing.assert_allclose(dense(body, band)[np.ix_(ours, ours)], expected, atol=1e-12)


def _components(basis):
    """Return the component that each unknown of a vector basis moves."""
    component = np.zeros(basis.N, int)
    for local in range(basis.Nbfun):
        component[basis.element_dofs[local]] = local % 2
    return component


def _mul(a, b):
    return np.einsum("ij...,jk...->ik...", a, b)


def test_newton_converges_quadratically(body, patch, bent):
    """Its order, of the last residuals above rounding."""
    steps = list(iterates(body, patch, 1.1 * LOAD, bent))
    residuals = np.array([residual for _, residual, _ in steps if residual > 1e-13])
    assert len(residuals) <= 6
    order = np.diff(np.log(residuals))
    assert order[-1] / order[-2] > 1.9


def test_energy_is_the_work_of_the_load(body):
    """The path is followed by Gauss's quadrature of F times the load's path under it."""
    patch = patch_at(body.grid, 0.9, CARVED.patch)
    points, weights = np.polynomial.legendre.leggauss(12)
    forces = LOAD * (1 + points) / 2
    states = solve_loads(body, patch, [*forces, LOAD])
    power = [
        force * patch.unit_load(u) @ rate(body, patch, force, u)
        for force, u in zip(forces, states, strict=False)
    ]
    work = LOAD / 2 * weights @ power
    assert work == pytest.approx(body.energy(states[-1]), rel=1e-9)


def test_a_mirrored_outline_loaded_from_below_bends_up():
    mirrored = Profile(CARVED.x, -CARVED.bottom, -CARVED.top)
    found = []
    for profile, side in ((CARVED, "top"), (mirrored, "bottom")):
        body = Body(plectrum_grid(profile, 20, 2), NU)
        patch = patch_at(body.grid, 0.9, profile.patch, 0.1, side)
        u = solve_loads(body, patch, [LOAD])[0]
        section = section_at(body.grid, 0.9)
        found.append([*section.displacement(u), section.rotation(u)])
    np.testing.assert_allclose(found[0], np.multiply(found[1], [1, -1, -1]), rtol=1e-9)


def test_the_patch_carries_one_newton_at_its_place(body):
    """Its share sums to one and its mean is s, also across columns and at the very tip."""
    for s in (0.3, 0.513, 1.0):
        patch = patch_at(body.grid, s, CARVED.patch)
        assert patch.fractions.sum() == pytest.approx(1, rel=1e-14)
        assert patch.fractions @ body.grid.nodes[:, 0] == pytest.approx(s, rel=1e-13)
        assert patch.slopes @ body.grid.nodes[:, 0] == pytest.approx(1, rel=1e-13)
        _, slope, _ = CARVED.contact_line(s)
        assert np.tan(patch.angle(np.zeros(body.size))) == pytest.approx(float(slope), abs=1e-3)
