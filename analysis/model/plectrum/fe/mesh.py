"""A mesh between the plectrum's two edges."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.profile import Profile, bump

COLUMNS = 60  # Number of elements from clamp to tip


def columns(profile: Profile, count: int) -> Floats:
    """Return the edges of about ``count`` equal columns to the tip, and of a lip past it.

    A kink of the outline becomes the edge of a column if kinks are far enough apart. The lip, as
    long as half a patch, completes the patch of a load at the tip.
    """
    x = np.linspace(0.0, 1.0, count + 1)
    taken: set[int] = set()
    for before, after in pairwise(range(len(profile.x) - 1)):
        kink = profile.x[after]
        near = int(np.argmin(np.abs(x - kink)))
        apart = kink - profile.x[before] > 1 / count
        if 0 < near < count and near not in taken and apart:
            x[near] = kink
            taken.add(near)
    lip = max(1, round(profile.patch * count))
    return np.concatenate([x, 1 + profile.patch * np.arange(1, lip + 1) / lip])


@dataclass(frozen=True)
class Grid:
    """Nodes and quadrature of a mesh; nodes are numbered up each column, columns to the tip.

    With c columns and l layers there are (2 c + 1) (2 l + 1) nodes.
    """

    x: Floats
    """In lengths, edges of the columns, shape (columns + 1,)."""
    layers: int
    nodes: Floats
    """In lengths, shape (nodes, 2)."""
    cells: NDArray[np.intp]
    """Nodes of each element, shape (elements, 9)."""
    gradients: Floats
    """Gradients of the shape functions, shape (elements, points, 9, 2)."""
    weights: Floats
    """Weights of the quadrature, shape (elements, points)."""

    @property
    def height(self) -> int:
        """Nodes in a column."""
        return 2 * self.layers + 1


def plectrum_grid(profile: Profile, count: int = COLUMNS, layers: int = 4) -> Grid:
    """Mesh a plectrum with ``count`` columns and ``layers`` layers of elements."""
    return grid_between(profile, columns(profile, count), layers)


def grid_between(profile: Profile, x: Floats, layers: int) -> Grid:
    """Mesh a plectrum by biquadratic quadrilaterals in columns whose edges are at x."""
    # Imported here because a stored map does not need it.
    from skfem import Basis, ElementQuad2, MeshQuad

    square = MeshQuad.init_tensor(x, np.linspace(0.0, 1.0, layers + 1))
    top, bottom = profile.edges(square.p[0])
    mesh = MeshQuad(np.vstack([square.p[0], bottom + square.p[1] * (top - bottom)]), square.t)
    basis = Basis(mesh, ElementQuad2(), intorder=5)
    flat = np.round(Basis(square, ElementQuad2()).doflocs, 9)
    order = np.lexsort((flat[1], flat[0]))
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    gradients = np.array([basis.basis[a][0].grad for a in range(basis.Nbfun)])
    return Grid(
        x,
        layers,
        basis.doflocs[:, order].T.copy(),
        rank[basis.element_dofs.T],
        np.ascontiguousarray(gradients.transpose(2, 3, 0, 1)),
        basis.dx,
    )


def _shapes(xi: Floats) -> Floats:
    """Return the three quadratic shape functions on [0, 1], shape (3, n)."""
    return np.array([(1 - xi) * (1 - 2 * xi), 4 * xi * (1 - xi), xi * (2 * xi - 1)])


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

    def turning(self, u: Floats) -> Floats:
        """Return d(rotation)/du, shape (size,)."""
        x, z = self.director @ u.reshape(-1, 2)[self.nodes]
        out = np.zeros_like(u).reshape(-1, 2)
        out[self.nodes] = np.outer(self.director, [-(1 + z), x]) / (x**2 + (1 + z) ** 2)
        return out.ravel()

    def rotation_rate(self, rate: Floats) -> float:
        """Return the initial angular velocity of the section when u grows from 0 by ``rate``."""
        return -float(self.director @ rate.reshape(-1, 2)[self.nodes, 0])


def section_at(grid: Grid, s: float) -> Section:
    """Return the section at s [lengths]; its integrals over the height are exact."""
    column = int(np.clip(np.searchsorted(grid.x, s, "right") - 1, 0, len(grid.x) - 2))
    xi = (s - grid.x[column]) / (grid.x[column + 1] - grid.x[column])
    value = _shapes(np.array([xi]))
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


@dataclass(frozen=True)
class Patch:
    """Distribution of the load over the nodes, and what its direction depends on."""

    fractions: Floats
    """Fraction of the load at each node; the sum is 1; shape (nodes,)."""
    section: Section
    """The section under the middle of the patch."""
    sign: float
    """1 for a load on the top, -1 for one on the bottom."""
    drag: float = 0.0
    """Load along the section's tangent, towards the tip, over the one along its normal."""

    def unit_load(self, u: Floats) -> Floats:
        """Return the nodal forces of F = 1, shape (size,)."""
        return np.outer(self.fractions, self.direction(u)).ravel()

    def turning(self, u: Floats) -> tuple[Floats, Floats]:
        """Return g and p, for the tangent F g p^T of the load, each of shape (size,)."""
        x, z = self.direction(u)
        return np.outer(self.fractions, [-z, x]).ravel(), self.section.turning(u)

    def direction(self, u: Floats) -> Floats:
        """Return the load's direction, whose normal part has the length 1."""
        turned = self.section.rotation(u)
        cosine, sine = np.cos(turned), np.sin(turned)
        normal = self.sign * np.array([sine, -cosine])
        return normal + self.drag * np.array([cosine, sine])


def patch_at(
    grid: Grid, s: float, half: float, drag: float = 0.0, side: Literal["top", "bottom"] = "top"
) -> Patch:
    """Return the load on a patch of half length ``half`` about s [both in lengths]."""
    fractions = np.zeros(len(grid.nodes))
    points, weights = np.polynomial.legendre.leggauss(6)  # exact for bump x quadratics
    edge = grid.layers * 2 if side == "top" else 0
    for column, (left, right) in enumerate(zip(grid.x[:-1], grid.x[1:], strict=True)):
        low, high = max(left, s - half), min(right, s + half)
        if low >= high:
            continue
        x = (low + high) / 2 + (high - low) / 2 * points
        weight = weights * (high - low) / 2 * bump((x - s) / half) / half
        value = _shapes((x - left) / (right - left))
        nodes = (2 * column + np.arange(3)) * grid.height + edge
        fractions[nodes] += value @ weight
    return Patch(fractions, section_at(grid, s), 1.0 if side == "top" else -1.0, drag)
