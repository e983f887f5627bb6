"""The table of one shape of plectrum: where its contact point is under any load and friction."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.chebyshev import chebpts1, chebvander
from numpy.typing import ArrayLike

from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.cantilever import FRICTION_MAX

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

TURN = 1.568
"""rad, by which the tip turns at the largest load without friction: nearly 90 degrees, past which
nothing would hold the string."""
ORDER = 6  # Coefficients of the polynomial of the load in a cell


@dataclass(frozen=True, eq=False)
class Table:
    """x/s, z/(s q) and theta/q of one shape of plectrum, as piecewise polynomials.

    Along the plectrum they are polynomials of u, which is -1 and 1 at the ends of each of `parts`
    equal parts from `nearest` to the tip; of a uniform plectrum they are constant. z is counted
    from the unloaded contact line, theta from its slope.
    """

    cells: Floats
    """Chebyshev's terms in T, powers of q from the highest, cells over q, parts, powers of u from
    the lowest, and the three; dimensionless, shape (drags, `ORDER`, cells, parts, powers, 3)."""
    q_max: float
    """Largest load without friction."""
    line: Floats
    """Height [lengths] and slope [rad] of the unloaded contact line, shape (parts, powers, 2)."""
    nearest: float = 0.0
    """Smallest s, in lengths."""
    error: float = 0.0
    """Largest error found between the nodes, relative to displacement and rotation."""

    @property
    def uniform(self) -> bool:
        """Whether nothing depends on s."""
        return self.cells.shape[3:5] == (1, 1)

    @cached_property
    def flat(self) -> bool:
        """Whether the unloaded contact line runs along x."""
        return not self.line.any()

    def at(self, laws: Floats, place: Floats) -> Floats:
        """Return laws at places s/L, without the axes of parts and powers.

        Args:
            laws: Shape (parts, powers, ..., *place.shape), or one that fits it.
            place: s/L.
        """
        if self.uniform:
            return laws[0, 0]
        laws, u, _ = self._in_parts(laws, place)
        value = np.array(np.broadcast_to(laws[-1], np.broadcast_shapes(laws[-1].shape, u.shape)))
        for law in laws[-2::-1]:
            value *= u
            value += law
        return value

    def with_slopes(self, laws: Floats, place: Floats) -> tuple[Floats, Floats]:
        """Return laws at places s/L, as `at` does, and their slopes by s/L."""
        if self.uniform:
            return laws[0, 0], np.zeros((*laws.shape[2:3], *(1,) * (laws.ndim - 3)))
        laws, u, by_place = self._in_parts(laws, place)
        value = np.array(np.broadcast_to(laws[-1], np.broadcast_shapes(laws[-1].shape, u.shape)))
        slope = np.zeros_like(value)
        for law in laws[-2::-1]:
            slope *= u
            slope += value
            value *= u
            value += law
        slope *= by_place
        return value, slope

    def _in_parts(self, laws: Floats, place: Floats) -> tuple[Floats, Floats, float]:
        """Return the laws of the parts in which places are, u there, and du/d(s/L)."""
        parts = len(laws)
        wide = (1 - self.nearest) / parts
        cell = np.clip((place - self.nearest) / wide, 0, parts - 1).astype(int)
        u = 2 * (place - self.nearest) / wide - 2 * cell - 1
        if parts == 1:
            return laws[0], u, 2 / wide
        index = cell.reshape(1, 1, *(1,) * (laws.ndim - 2 - cell.ndim), *cell.shape)
        return np.take_along_axis(laws, index, 0)[0], u, 2 / wide

    def contact_line(self, place: Floats) -> tuple[Floats, Floats]:
        """Return height [lengths] and slope [rad] at places s/L, stacked, and their slopes."""
        shape = (*self.line.shape, *(1,) * place.ndim)
        return self.with_slopes(self.line.reshape(shape), place)

    def values(self, places: Floats, loads: Floats, drag: float) -> Floats:
        """Return the three at places (n,), loads (m,) and one drag, shape (3, m, n)."""
        laws = arranged(laws_under(self, drag)[0](loads))[..., None]
        return self.at(np.broadcast_to(laws, (*laws.shape[:-1], len(places))), places)

    def limit(self, friction: float) -> float:
        """Return the largest load at a friction: the tip turns by `TURN`, or the table ends."""
        return _limit(self, friction)


def arranged(laws: Floats) -> Floats:
    """Return laws (..., parts, powers, n) as `Table.at` takes them: (parts, powers, n, ...)."""
    last = laws.ndim - 3
    return laws.transpose(last, last + 1, last + 2, *range(last))


@lru_cache(maxsize=128)
def laws_under(table: Table, drag: float) -> "tuple[PPoly, PPoly]":
    """Return a table's laws as polynomials of q, and their derivatives by q.

    Both are called with loads q of any shape and return shape (..., parts, powers, 3).

    Args:
        drag: Force along the surface towards the tip over the one normal to it, at most 0.5 either
            way.
    """
    laws = _weighted(table, chebyshev(drag, len(table.cells) - 1)[0])
    return laws, laws.derivative()


@lru_cache(maxsize=32)
def laws_of_terms(table: Table) -> "tuple[PPoly, PPoly]":
    """Return the laws of all terms of the series in T, and their derivatives by q."""
    laws = _weighted(table, np.eye(len(table.cells)))
    return laws, laws.derivative()


@lru_cache(maxsize=128)
def sticking_laws(table: Table, friction: float) -> "PPoly":
    """Return the laws of a string that sticks, as polynomials of q.

    It is called with loads q of any shape and returns shape (..., 6, parts, powers, 3): the
    coefficients of the powers of drag over friction, the lowest first.
    """
    nodes = chebpts1(6)  # Of degree 5 in T, over a smaller range of T
    powers = np.linalg.inv(np.vander(nodes, increasing=True))
    return _weighted(table, powers @ chebyshev(friction * nodes, len(table.cells) - 1))


def _weighted(table: Table, weights: Floats) -> "PPoly":
    """Return weighted sums of a table's series in T; `weights` of shape (..., terms)."""
    from scipy.interpolate import PPoly

    summed = np.tensordot(weights, table.cells, 1)
    axes = np.arange(weights.ndim - 1, weights.ndim + 1)
    cells = np.ascontiguousarray(np.moveaxis(summed, axes, (0, 1)))
    return PPoly(cells, np.linspace(0.0, table.q_max, cells.shape[1] + 1))


@lru_cache(maxsize=128)
def _limit(table: Table, friction: float) -> float:
    from scipy.optimize import root_scalar

    places = np.linspace(table.nearest, 1.0, 9)

    def short_of(q: float) -> float:
        return TURN + q * float(table.values(places, np.array([q]), friction)[2].min())

    if short_of(table.q_max) >= 0:
        return table.q_max
    return root_scalar(short_of, bracket=(0.0, table.q_max), xtol=1e-14).root


def chebyshev(drag: ArrayLike, degree: int) -> Floats:
    """Return Chebyshev's polynomials of drags up to `FRICTION_MAX`; shape (..., degree + 1)."""
    return np.asarray(chebvander(np.asarray(drag, float) / FRICTION_MAX, degree), float)


def nodes(count: int, low: float, high: float) -> Floats:
    """Return Chebyshev's nodes between two ends, increasing."""
    return (low + high) / 2 + (high - low) / 2 * chebpts1(count)


def through(count: int, places: Floats, low: float, high: float) -> Floats:
    """Return the matrix from values at `nodes` to those of their polynomial at places (n,)."""
    at = (2 * places - low - high) / (high - low)
    return chebvander(at, count - 1) @ np.linalg.inv(chebvander(chebpts1(count), count - 1))


@dataclass(frozen=True)
class Samples:
    """A table's laws at Chebyshev's nodes; the other fields are those of the table."""

    laws: Floats
    """Shape (3, drags, loads, parts, positions)."""
    line: Floats
    """Height [lengths] and slope [rad] of the unloaded contact line, (2, parts, positions)."""
    cells: int
    q_max: float
    nearest: float = 0.0
    error: float = 0.0

    @property
    def nodes(self) -> tuple[Floats, Floats, Floats]:
        """Drags, loads and places of the nodes, the last of shape (parts, positions)."""
        _, drags, loads, parts, positions = self.laws.shape
        ends = np.linspace(self.nearest, 1.0, parts + 1)
        places = np.stack([nodes(positions, *end) for end in pairwise(ends)])
        return nodes(drags, -FRICTION_MAX, FRICTION_MAX), nodes(loads, 0.0, self.q_max), places

    def table(self) -> Table:
        """Return the table through the nodes."""
        _, drags, loads, _, positions = self.laws.shape
        # In each cell the polynomial passes through the series at Chebyshev's nodes.
        within = nodes(ORDER, 0.0, 1.0)
        places = (np.arange(self.cells) + within[:, None]) / self.cells
        to_cells = through(loads, places, 0.0, 1.0)
        to_powers = np.linalg.inv(np.vander(within, increasing=False))
        to_powers *= (self.cells / self.q_max) ** np.arange(ORDER - 1.0, -1, -1)[:, None]
        to_drag = np.linalg.inv(chebvander(chebpts1(drags), drags - 1))
        to_place = np.linalg.inv(np.vander(chebpts1(positions), increasing=True))
        found = np.einsum(
            "fg,po,ocn,us,lgnks->fpckul",
            to_drag, to_powers, to_cells, to_place, self.laws, optimize=True,
        )  # fmt: skip
        line = np.einsum("us,lks->kul", to_place, self.line)
        return Table(found, self.q_max, line, self.nearest, self.error)

    @property
    def probes(self) -> tuple[Floats, Floats, Floats]:
        """Places, loads and drags between the nodes, at which the table's error is found."""
        places = self.nearest + (1 - self.nearest) * np.array([0.07, 0.41, 0.67, 0.91])
        return places, self.q_max * np.array([0.12, 0.95]), FRICTION_MAX * np.array([-0.6, 0.45])

    def checked(self, exact: Floats) -> "Samples":
        """Return them with the error of their table.

        Args:
            exact: The laws at the `probes`, shape (3, drags, loads, places).
        """
        places, loads, drags = self.probes
        table = self.table()
        found = np.stack([table.values(places, loads, drag) for drag in drags.tolist()], 1)
        scale = np.abs(exact)
        # x/s is nearly 1. What matters of it is the shortening, which may pass through zero.
        scale[0] = np.abs(1 - exact[0]) + 0.02 * scale[1] * self.q_max
        return replace(self, error=float(np.max(np.abs(found - exact) / scale)))
