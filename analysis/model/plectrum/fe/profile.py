"""The plectrum's two edges, the contact line of the string, and a mesh between the edges."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.rig.instrument import Plectrum

SAME_LENGTH = 1e-3
"""Dimensionless tolerance on the length of an outline."""
COLUMNS = 60
"""Number of elements from clamp to tip."""
LAYERS = 4
"""Number of elements through the thickness."""


@dataclass(frozen=True)
class Profile:
    """Both edges in units of the plectrum's length, straight between places of shape (n,)."""

    x: Floats
    """From 0 at the clamp to 1 at the tip."""
    top: Floats
    """Height of the edge on the string's side."""
    bottom: Floats
    """Height of the other edge."""

    @property
    def clamp_thickness(self) -> float:
        """Thickness at the clamp, in lengths."""
        return float(self.top[0] - self.bottom[0])

    @property
    def clamp_middle(self) -> float:
        """Height of the mid-line at the clamp, in lengths."""
        return float(self.top[0] + self.bottom[0]) / 2

    @property
    def patch(self) -> float:
        """Half the length of the load's patch, in lengths: thickness / 4, at least 0.01."""
        return max(self.clamp_thickness / 4, 0.01)

    def edges(self, x: Floats) -> tuple[Floats, Floats]:
        """Return top and bottom at x; past the tip both continue parallel to the top."""
        beyond = np.maximum(x - 1, 0) * self._slopes()[-1]
        return np.interp(x, self.x, self.top) + beyond, np.interp(x, self.x, self.bottom) + beyond

    def contact_line(self, s: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return height, slope and curvature of the unloaded top, averaged over a patch at s.

        Because of the average a kink in the outline turns the normal over the length of the
        patch and not at once. The height is counted from the clamp.
        """
        s = np.asarray(s, float)
        slopes = self._slopes()
        u = (s[..., None] - self.x[1:-1]) / self.patch
        v = np.clip(u, -1, 1)
        passed = 15 / 16 * (v - 2 * v**3 / 3 + v**5 / 5) + 0.5
        area = 15 / 16 * (v**2 / 2 - v**4 / 6 + v**6 / 30) + v / 2 + 5 / 32 + np.maximum(u - 1, 0)
        turn = np.diff(slopes)
        return (
            slopes[0] * s + self.patch * area @ turn,
            slopes[0] + passed @ turn,
            bump(u) @ turn / self.patch,
        )

    def _slopes(self) -> Floats:
        return np.diff(self.top) / np.diff(self.x)


def bump(u: Floats) -> Floats:
    """Return the patch's pressure, of unit area on -1 < u < 1 and smooth at its ends."""
    return 15 / 16 * np.maximum(1 - u**2, 0) ** 2


def profile_of(plectrum: Plectrum) -> Profile:
    """Return a plectrum's outline, or that of its thicknesses, in units of its length.

    A thinner tip is cut from below; the step is a bevel that is as long as it is high.

    Raises:
        ModelError: The outline is not as long as the plectrum.
    """
    outline = plectrum.outline
    if outline is None:
        half, places, depth = plectrum.thickness / plectrum.length / 2, [0.0, 1.0], [0.0, 0.0]
        if plectrum.described:
            step = (plectrum.thickness - (plectrum.tip_thickness or 0.0)) / plectrum.length
            joint = 1 - (plectrum.tip_length or plectrum.length / 2) / plectrum.length
            bevel = min(abs(step), 2 * joint, 2 * (1 - joint)) / 2
            places, depth = [0.0, joint - bevel, joint + bevel, 1.0], [0.0, 0.0, step, step]
        return Profile(np.array(places), np.full(len(places), half), np.array(depth) - half)
    end = outline.x[-1]
    if abs(end - plectrum.length) > SAME_LENGTH * plectrum.length:
        raise ModelError(
            f"plectrum.outline: it ends at x = {end * 1e3:.6g} mm and plectrum.length is"
            f" {plectrum.length * 1e3:.6g} mm; make them equal"
        )
    x, top, bottom = (np.array(edge) / end for edge in (outline.x, outline.top, outline.bottom))
    return Profile(x, top, bottom)


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
