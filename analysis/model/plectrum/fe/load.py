"""The string's load on the deformed surface, and the section under it.

The string is a stiff wire across the plectrum. Its pressure is distributed smoothly along the
surface and has one direction, normal to the mean tangent of the surface under it. Friction
adds mu F along that tangent, towards the tip. The resultant is F for every mesh.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.fe.profile import Grid, bump


def _shapes(xi: Floats) -> tuple[Floats, Floats]:
    """Return the three quadratic shape functions on [0, 1] and their slopes, shape (3, n)."""
    value = np.array([(1 - xi) * (1 - 2 * xi), 4 * xi * (1 - xi), xi * (2 * xi - 1)])
    return value, np.array([4 * xi - 3, 4 - 8 * xi, 4 * xi - 1])


@dataclass(frozen=True)
class Patch:
    """Distribution of the load over the nodes, and what its direction depends on."""

    fractions: Floats
    """Fraction of the load at each node; the sum is 1; shape (nodes,)."""
    slopes: Floats
    """Weights of the nodes' positions in the mean tangent, shape (nodes,)."""
    friction: float
    """Coulomb coefficient, dimensionless."""
    sign: float
    """1 for a load on the top, -1 for one on the bottom."""
    nodes: Floats
    """1, undeformed, shape (nodes, 2)."""

    def angle(self, u: Floats) -> float:
        """Return the mean direction [rad] of the deformed surface under the patch."""
        tangent = self.slopes @ (self.nodes + u.reshape(-1, 2))
        return float(np.arctan2(tangent[1], tangent[0]))

    def unit_load(self, u: Floats) -> Floats:
        """Return the nodal forces of F = 1, shape (size,)."""
        return np.outer(self.fractions, self.direction(u)).ravel()

    def turning(self, u: Floats) -> tuple[Floats, Floats]:
        """Return g and p, for the tangent F g p^T of the load, each of shape (size,)."""
        tangent = self.slopes @ (self.nodes + u.reshape(-1, 2))
        across = np.array([-tangent[1], tangent[0]]) / (tangent @ tangent)
        x, z = self.direction(u)
        return np.outer(self.fractions, [-z, x]).ravel(), np.outer(self.slopes, across).ravel()

    def direction(self, u: Floats) -> Floats:
        """Return the load's direction, whose normal part has the length 1."""
        cosine, sine = np.cos(self.angle(u)), np.sin(self.angle(u))
        normal = self.sign * np.array([sine, -cosine])
        return normal + self.friction * np.array([cosine, sine])


def patch_at(
    grid: Grid, s: float, half: float, friction: float = 0.0, side: Literal["top", "bottom"] = "top"
) -> Patch:
    """Return the load on a patch of half length ``half`` about s [both in lengths]."""
    fractions, slopes = np.zeros(len(grid.nodes)), np.zeros(len(grid.nodes))
    points, weights = np.polynomial.legendre.leggauss(6)  # exact for bump x quadratics
    edge = grid.layers * 2 if side == "top" else 0
    for column, (left, right) in enumerate(zip(grid.x[:-1], grid.x[1:], strict=True)):
        low, high = max(left, s - half), min(right, s + half)
        if low >= high:
            continue
        x = (low + high) / 2 + (high - low) / 2 * points
        weight = weights * (high - low) / 2 * bump((x - s) / half) / half
        value, slope = _shapes((x - left) / (right - left))
        nodes = (2 * column + np.arange(3)) * grid.height + edge
        fractions[nodes] += value @ weight
        slopes[nodes] += slope @ weight / (right - left)
    return Patch(fractions, slopes, friction, 1.0 if side == "top" else -1.0, grid.nodes)


@dataclass(frozen=True)
class Section:
    """Weights for the mean displacement and mean rotation of a section."""

    nodes: NDArray[np.intp]
    """Nodes that the section depends on, shape (n,)."""
    mean: Floats
    """Weights of the nodes in the mean over the section, shape (n,)."""
    director: Floats
    """Weights of the nodes in the gradient up the section, shape (n,)."""

    def displacement(self, u: Floats) -> Floats:
        """Return the section's mean displacement, shape (2,)."""
        return self.mean @ u.reshape(-1, 2)[self.nodes]

    def rotation(self, u: Floats) -> float:
        """Return the section's mean rotation [rad], positive from x to z."""
        x, z = self.director @ u.reshape(-1, 2)[self.nodes]
        return float(np.arctan2(-x, 1 + z))

    def rotation_rate(self, rate: Floats) -> float:
        """Return the initial angular velocity of the section when u grows from 0 by ``rate``."""
        return -float(self.director @ rate.reshape(-1, 2)[self.nodes, 0])


def section_at(grid: Grid, s: float) -> Section:
    """Return the section at s [lengths]; its integrals over the height are exact."""
    column = int(np.clip(np.searchsorted(grid.x, s, "right") - 1, 0, len(grid.x) - 2))
    xi = (s - grid.x[column]) / (grid.x[column + 1] - grid.x[column])
    value, _ = _shapes(np.array([xi]))
    nodes = (2 * column + np.arange(3))[:, None] * grid.height + np.arange(grid.height)
    simpson: Floats = np.ones(grid.height)
    simpson[1::2] = 4
    simpson[2:-1:2] = 2
    simpson /= 6.0 * grid.layers
    height = value[:, 0] @ grid.nodes[nodes, 1]
    off = height - simpson @ height
    return Section(
        nodes.ravel(),
        np.outer(value[:, 0], simpson).ravel(),
        np.outer(value[:, 0], simpson * off).ravel() / (simpson @ off**2),
    )
