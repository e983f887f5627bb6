"""A mesh between the plectrum's two edges."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.profile import Profile

COLUMNS = 60  # Number of elements from clamp to tip
LAYERS = 4  # Number of elements through the thickness


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


def plectrum_grid(profile: Profile, count: int = COLUMNS, layers: int = LAYERS) -> Grid:
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
