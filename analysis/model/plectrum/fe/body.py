"""Large strains of a plane-stress body: energy, internal forces and their tangent.

Green-Lagrange strain E = (grad u + grad u^T + grad u^T grad u) / 2, St. Venant-Kirchhoff
stress S = D E; R(v) = int S : dE(v) and K(v, w) = int dE(v) : D dE(w) + S : (grad v^T grad w).
For 60 x 4 elements scikit-fem's assembler takes 62 ms for the same forms, this code 4 ms.
"""

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.fe.mesh import Grid


class Body:
    """A meshed body of unit modulus, clamped at its first column of nodes."""

    def __init__(self, grid: Grid, poisson_ratio: float):
        nu = poisson_ratio
        self.grid = grid
        self.stiffness = np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]]) / (1 - nu**2)
        """Plane stress, for strains (E11, E22, 2 E12), shape (3, 3)."""
        self.size = grid.nodes.size
        self.clamped = 2 * grid.height
        """Number of unknowns at the start that are zero; unknown 2 n + i moves node n along i."""
        unknowns = (2 * grid.cells[:, :, None] + np.arange(2)).reshape(len(grid.cells), 18)
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
        gradients = self.grid.gradients
        pulled = (gradients @ tensor).transpose(0, 1, 3, 2).reshape(elements, 2 * points, 9)
        plain = gradients.transpose(0, 1, 3, 2).reshape(elements, 2 * points, 9)
        geometric = plain.transpose(0, 2, 1) @ pulled
        tangent = tangent.reshape(elements, 9, 2, 9, 2)
        tangent[:, :, 0, :, 0] += geometric
        tangent[:, :, 1, :, 1] += geometric
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
        gradients = self.grid.gradients
        first = gradients[..., 0, None] * deformation[..., None, :, 0]
        second = gradients[..., 1, None] * deformation[..., None, :, 1]
        mixed = (
            gradients[..., 1, None] * deformation[..., None, :, 0]
            + gradients[..., 0, None] * deformation[..., None, :, 1]
        )
        strains = np.stack([first, second, mixed], -3)
        return strains.reshape(*strains.shape[:-2], 18)

    def _forces(self, strains: Floats, stress: Floats) -> Floats:
        weighted = self.grid.weights[..., None] * stress
        elements = np.einsum("epvk,epv->ek", strains, weighted, optimize=True)
        return _summed(self._unknowns, elements, self.size)


def _summed(places: NDArray[np.intp], values: Floats, count: int) -> Floats:
    """Return the sum of the values at each of ``count`` places."""
    return np.asarray(np.bincount(places, values.ravel(), count), float)
