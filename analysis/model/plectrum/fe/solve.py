"""Large strains of a plane-stress body, and Newton's method continued from load to load.

Green-Lagrange strain E = (grad u + grad u^T + grad u^T grad u) / 2, St. Venant-Kirchhoff
stress S = D E; R(v) = int S : dE(v) and K(v, w) = int dE(v) : D dE(w) + S : (grad v^T grad w).
For 60 x 4 elements scikit-fem's assembler takes 62 ms for the same forms, this code 4 ms.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.fe.mesh import Grid, Patch


class Elastic(NamedTuple):
    """A material, isotropic or with fibres along the plectrum; moduli in units of that along it."""

    poisson_ratio: float
    """Contraction across over the strain along, of a load along."""
    across: float = 1.0
    """Young's modulus across."""
    shear: float | None = None
    """Shear modulus; None for that of an isotropic material."""

    @property
    def stiffness(self) -> Floats:
        """Plane stress, for strains (E11, E22, 2 E12), shape (3, 3)."""
        nu, across = self.poisson_ratio, self.across
        rest = 1 - nu**2 * across  # nu_12 nu_21, with nu_21 = nu_12 E_2 / E_1
        shear = 1 / (2 * (1 + nu)) if self.shear is None else self.shear
        normal = [[1, nu * across, 0], [nu * across, across, 0]]
        return np.array([*normal, [0, 0, shear * rest]]) / rest


class Body:
    """A meshed body of unit modulus, clamped at its first column of nodes."""

    def __init__(self, grid: Grid, material: Elastic):
        self.grid, self.stiffness = grid, material.stiffness
        self.size = grid.nodes.size
        self.clamped = 2 * grid.height
        """Number of unknowns at the start that are zero; unknown 2 n + i moves node n along i."""
        # Of an element the unknowns along x come first, which keeps what is multiplied contiguous.
        unknowns = (2 * grid.cells[:, None, :] + np.arange(2)[:, None]).reshape(-1, 18)
        self._slopes = np.ascontiguousarray(grid.gradients.swapaxes(-1, -2))
        self._unknowns = unknowns.ravel()
        rows, columns = unknowns[:, :, None], unknowns[:, None, :]
        self.band = int((rows - columns).max())
        self._places = ((self.band + rows - columns) * self.size + columns).ravel()

    def energy(self, u: Floats) -> float:
        """Return the strain energy [E L^3, of unit width] of displacements u, shape (size,)."""
        _, strain, stress = self._state(u)
        return float(np.sum(self.grid.weights * np.sum(strain * stress, -1)) / 2)

    def forces(self, u: Floats) -> Floats:
        """Return the internal forces of displacements u, both of shape (size,)."""
        deformation, _, stress = self._state(u)
        return self._forces(self._strains(deformation), stress)

    def linearised(self, u: Floats) -> tuple[Floats, Floats]:
        """Return the internal forces and their tangent in LAPACK's band storage.

        The tangent has the shape (2 band + 1, size): entry [band + i - j, j] is K_ij.
        """
        deformation, _, stress = self._state(u)
        strains = self._strains(deformation)
        elements, points = self.grid.weights.shape
        weighted = self.grid.weights[..., None, None] * (self.stiffness @ strains)
        rows = strains.reshape(elements, 3 * points, 18)
        tangent = rows.transpose(0, 2, 1) @ weighted.reshape(elements, 3 * points, 18)
        s11, s22, s12 = np.moveaxis(self.grid.weights[..., None] * stress, -1, 0)
        tensor = np.stack([np.stack([s11, s12], -1), np.stack([s12, s22], -1)], -2)
        pulled = (tensor @ self._slopes).reshape(elements, 2 * points, 9)
        plain = self._slopes.reshape(elements, 2 * points, 9)
        geometric = plain.transpose(0, 2, 1) @ pulled
        tangent[:, :9, :9] += geometric
        tangent[:, 9:, 9:] += geometric
        count = (2 * self.band + 1) * self.size
        band = _summed(self._places, tangent, count)
        return self._forces(strains, stress), band.reshape(-1, self.size)

    def _state(self, u: Floats) -> tuple[Floats, Floats, Floats]:
        """Return deformation gradient, strain and stress at the quadrature's points."""
        moved = u.reshape(-1, 2)[self.grid.cells]
        slope = moved.transpose(0, 2, 1)[:, None] @ self.grid.gradients
        green = (slope + slope.swapaxes(-1, -2) + slope.swapaxes(-1, -2) @ slope) / 2
        strain = np.stack([green[..., 0, 0], green[..., 1, 1], 2 * green[..., 0, 1]], -1)
        return np.eye(2) + slope, strain, strain @ self.stiffness

    def _strains(self, deformation: Floats) -> Floats:
        """Return dE of every unknown, shape (elements, points, 3, 18)."""
        along, up = np.moveaxis(self._slopes[..., None, :], -3, 0)
        first, second = np.moveaxis(deformation[..., None], -2, 0)
        strains = np.empty((*along.shape[:2], 3, 2, 9))
        np.multiply(along, first, strains[:, :, 0])
        np.multiply(up, second, strains[:, :, 1])
        np.multiply(up, first, strains[:, :, 2])
        strains[:, :, 2] += along * second
        return strains.reshape(*strains.shape[:-2], 18)

    def _forces(self, strains: Floats, stress: Floats) -> Floats:
        weighted = self.grid.weights[..., None] * stress
        elements = np.einsum("epvk,epv->ek", strains, weighted, optimize=True)
        return _summed(self._unknowns, elements, self.size)


def _summed(places: NDArray[np.intp], values: Floats, count: int) -> Floats:
    """Return the sum of the values at each of ``count`` places."""
    return np.asarray(np.bincount(places, values.ravel(), count), float)


def solve_loads(body: Body, patch: Patch, forces: Sequence[float] | Floats) -> list[Floats]:
    """Return the displacements, each of shape (size,), under forces in increasing order.

    Every step starts from the extrapolation of the steps before it; a step that does not
    converge is halved.

    Args:
        forces: Normal forces, in E W L.

    Raises:
        ModelError: A step does not converge after all halvings.
    """
    path = [(0.0, np.zeros(body.size))]
    found = []
    for target in forces:
        target = float(target)
        halvings = 0
        while path[-1][0] != target:
            step = (target - path[-1][0]) / 2**halvings
            force = target if halvings == 0 else path[-1][0] + step
            u = newton(body, patch, force, _extrapolated(path, force))
            if u is not None:
                path = [*path[-4:], (force, u)]
                halvings = max(0, halvings - 1)
            elif halvings < 8:
                halvings += 1
            else:
                raise ModelError(
                    f"plectrum: its finite elements find no equilibrium past a load of"
                    f" {path[-1][0]:.4g} E W L, on the way to {target:.4g}; lower the"
                    " force, or correct plectrum.outline where it is thin"
                )
        found.append(path[-1][1])
    return found


def newton(body: Body, patch: Patch, force: float, u: Floats) -> Floats | None:
    """Return the displacements at a force, starting from u; None if Newton's method fails."""
    for guess, residual, tolerance in iterates(body, patch, force, u):
        if residual <= tolerance:
            return guess
        if not residual < 1e6 * force + 1:
            return None
    return None


def _solved(band: Floats, right: Floats) -> Floats:
    """Return the solution of a symmetric system in band storage; shape of the right side.

    Raises:
        LinAlgError: It is singular.
    """
    from scipy.linalg import LinAlgError, solve_banded, solveh_banded

    width = len(band) // 2
    try:
        return solveh_banded(band[: width + 1], right, check_finite=False)
    except LinAlgError:  # not positive definite
        return solve_banded((width, width), band, right, check_finite=False)


def iterates(body: Body, patch: Patch, force: float, u: Floats):
    """Yield displacements, largest residual and its tolerance, starting with u."""
    from scipy.linalg import LinAlgError

    free, width = slice(body.clamped, None), body.band
    for _ in range(12):  # Per load step
        internal, band = body.linearised(u)
        load = force * patch.unit_load(u)
        residual = (load - internal)[free]
        rounding = 8 * np.finfo(float).eps * np.abs(u).max() * np.abs(band[width]).max()
        # Relative to the load, apart from rounding.
        yield u, np.abs(residual).max(), 1e-10 * np.abs(load).max() + rounding
        g, p = (part[free] for part in patch.turning(u))
        if not np.all(np.isfinite(band)):
            return
        try:
            step, turn = _solved(band[:, free], np.column_stack([residual, g])).T
        except LinAlgError:
            return
        # Sherman-Morrison: the load follows the surface, which adds F g p^T to the tangent.
        step = step + turn * (force * (p @ step) / (1 - force * (p @ turn)))
        u = u.copy()
        u[free] += step


def rate(body: Body, patch: Patch, force: float, u: Floats) -> Floats:
    """Return du/dF, shape (size,), at an equilibrium."""
    return responses(body, patch, force, u, [patch.unit_load(u)])[0]


def responses(
    body: Body, patch: Patch, force: float, u: Floats, loads: Sequence[Floats]
) -> list[Floats]:
    """Return the displacements that small loads add at an equilibrium, each of shape (size,)."""
    if not loads:
        return []
    free = slice(body.clamped, None)
    _, band = body.linearised(u)
    g, p = (part[free] for part in patch.turning(u))
    right = np.column_stack([*(load[free] for load in loads), g])
    *straight, turn = _solved(band[:, free], right).T
    found = []
    for own in straight:
        out = np.zeros(body.size)
        out[free] = own + turn * (force * (p @ own) / (1 - force * (p @ turn)))
        found.append(out)
    return found


def _extrapolated(path: list[tuple[float, Floats]], force: float) -> Floats:
    """Return the extrapolation of the steps so far to a force, by Lagrange's polynomial."""
    known = np.array([step[0] for step in path])
    guess = np.zeros_like(path[0][1])
    for i, (place, u) in enumerate(path):
        others = np.delete(known, i)
        guess += u * np.prod((force - others) / (place - others))
    return guess
