"""The elements themselves: patch, rate, tangent, energy, scikit-fem's own forms, mirror."""

import numpy as np
import pytest
from scipy.linalg import solve_banded
from scipy.sparse import dia_array
from scipy.spatial import cKDTree
from skfem import Basis, BilinearForm, ElementQuad2, ElementVector, LinearForm, MeshQuad
from skfem.helpers import ddot, grad, transpose
from skfem.quadrature import get_quadrature
from skfem.refdom import RefQuad

from sautereau.analysis.model.plectrum.fe.mesh import (
    grid_between,
    patch_at,
    plectrum_grid,
    section_at,
)
from sautereau.analysis.model.plectrum.fe.solve import Body, Elastic, iterates, rate, solve_loads
from sautereau.analysis.model.plectrum.profile import Profile

NU = 0.35
CARVED = Profile(
    np.array([0.0, 0.4, 1.0]), np.array([0.06, 0.05, 0.02]), np.array([-0.06, -0.05, -0.04])
)
"""Neither even about its mid-line nor of one slope."""
LOAD = 1.5e-4  # E W L, which turns `CARVED` by half a radian


@pytest.fixture(scope="module")
def body():
    return Body(plectrum_grid(CARVED, 20, 2), Elastic(NU))


@pytest.fixture(scope="module")
def patch(body):
    return patch_at(body.grid, 0.9, CARVED.patch, 0.1)


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


def test_newton_has_the_exact_tangent_and_needs_few_steps(body, patch, bent):
    """The tangent of forces and load is their derivative; stiff and soft modes hide its order."""
    _, band = body.linearised(bent)
    g, p = patch.turning(bent)
    step = np.random.default_rng(5).standard_normal(body.size)
    step[: body.clamped] = 0

    def residual(u):
        return body.forces(u) - LOAD * patch.unit_load(u)

    measured = (residual(bent + 1e-7 * step) - residual(bent - 1e-7 * step)) / 2e-7
    tangent = dense(body, band) @ step - LOAD * g * (p @ step)
    np.testing.assert_allclose(measured, tangent, atol=1e-7 * np.abs(tangent).max())
    residuals = [size for _, size, _ in iterates(body, patch, 1.1 * LOAD, bent)]
    assert sum(size > 1e-13 for size in residuals) <= 4


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
        body = Body(plectrum_grid(profile, 20, 2), Elastic(NU))
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


def test_a_rigid_rotation_strains_nothing(body):
    turn = np.array([[np.cos(2), -np.sin(2)], [np.sin(2), np.cos(2)]]) - np.eye(2)
    u = (body.grid.nodes @ turn.T).ravel()
    assert body.energy(u) < 1e-28
    assert np.abs(body.forces(u)).max() < 1e-14


@pytest.mark.slow
def test_convergence_at_the_rate_of_the_element():
    """A manufactured solution: errors fall with the square, and the cube, of the size."""
    trapezoid = Profile(np.array([0.0, 1.0]), np.array([0.3, 0.2]), np.array([-0.2, -0.3]))
    points, _ = get_quadrature(RefQuad, 5)
    element = ElementQuad2()
    shapes = np.array([element.lbasis(points, a)[0] for a in range(9)])

    def exact(x, z):
        return np.stack([0.2 * np.sin(2 * x) * x * z, 0.3 * (1 - np.cos(2 * x)) * np.exp(z)], -1)

    def slope(x, z):
        x_x = 0.2 * (2 * np.cos(2 * x) * x + np.sin(2 * x)) * z
        z_x = 0.6 * np.sin(2 * x) * np.exp(z)
        x_z = 0.2 * np.sin(2 * x) * x
        z_z = 0.3 * (1 - np.cos(2 * x)) * np.exp(z)
        return np.stack([np.stack([x_x, x_z], -1), np.stack([z_x, z_z], -1)], -2)

    errors = []
    for count in (4, 8, 16):
        body = Body(grid_between(trapezoid, np.linspace(0, 1, count + 1), count // 2), Elastic(NU))
        grid = body.grid
        places = np.einsum("aq,eai->eqi", shapes, grid.nodes[grid.cells])
        h = slope(*np.moveaxis(places, -1, 0))
        green = (h + h.swapaxes(-1, -2) + h.swapaxes(-1, -2) @ h) / 2
        strain = np.stack([green[..., 0, 0], green[..., 1, 1], 2 * green[..., 0, 1]], -1)
        load = body._forces(body._strains(np.eye(2) + h), strain @ body.stiffness)
        u, free = exact(*grid.nodes.T).ravel(), slice(body.clamped, None)
        for _ in range(12):
            forces, band = body.linearised(u)
            u[free] += solve_banded((body.band, body.band), band[:, free], (load - forces)[free])
        moved = u.reshape(-1, 2)[grid.cells]
        off = np.einsum("aq,eai->eqi", shapes, moved) - exact(*np.moveaxis(places, -1, 0))
        off_slope = np.einsum("eai,eqaj->eqij", moved, grid.gradients) - h
        errors.append(
            [
                np.sqrt(np.sum(grid.weights * np.sum(off**2, -1))),
                np.sqrt(np.sum(grid.weights * np.sum(off_slope**2, (-1, -2)))),
            ]
        )
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(rates[-1], [3, 2], atol=0.1)


def test_forces_are_the_derivative_of_the_energy(body, bent):
    direction = bent + 0.1 * np.sin(body.grid.nodes).ravel()
    h = 1e-5
    measured = (body.energy(bent + h * direction) - body.energy(bent - h * direction)) / (2 * h)
    assert measured == pytest.approx(body.forces(bent) @ direction, rel=1e-7)


def test_patch_test_of_a_large_uniform_strain(body):
    """A uniform gradient, in quadrilaterals of any shape, leaves no force inside."""
    slope = np.array([[0.3, -0.2], [0.1, 0.4]])
    u = (body.grid.nodes @ slope.T).ravel()
    forces = body.forces(u).reshape(-1, 2)
    inside = np.zeros(len(forces), bool)
    inside.reshape(-1, body.grid.height)[1:-1, 1:-1] = True
    assert np.abs(forces[inside]).max() < 1e-15
    green = (slope + slope.T + slope.T @ slope) / 2
    strain = np.array([green[0, 0], green[1, 1], 2 * green[0, 1]])
    area = body.grid.weights.sum()
    assert body.energy(u) == pytest.approx(area * strain @ body.stiffness @ strain / 2, rel=1e-13)


def test_tangent_is_the_derivative_of_the_forces(body, patch, bent):
    """Load and all, against central differences."""
    random = np.random.default_rng(1)
    _, band = body.linearised(bent)
    g, p = patch.turning(bent)
    matrix = dense(body, band)
    assert np.abs(matrix - matrix.T).max() < 1e-13
    for _ in range(3):
        direction = random.standard_normal(body.size)
        h = 1e-6 / np.abs(direction).max()

        def residual(u):
            return body.forces(u) - 3 * patch.unit_load(u)

        measured = (residual(bent + h * direction) - residual(bent - h * direction)) / (2 * h)
        formula = matrix @ direction - 3 * g * (p @ direction)
        assert np.abs(measured - formula).max() < 1e-7 * np.abs(formula).max()
