"""The elastica's map for one friction as local polynomials: quick for many cases or for one.

Every quantity of the elastica at s under F is s^k times a function of q = F s^2 / EI alone.
Four of them, x/s, z/s and the two components of the string's force over F, are cut into
cells of q, in each of which a polynomial through Chebyshev's nodes answers to rounding.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sautereau.analysis.model.plectrum.base import Bend, Floats
from sautereau.analysis.model.plectrum.elastica import Elastica
from sautereau.rig.instrument import Plectrum

CELLS = 128
"""Cells of the table over q."""
ORDER = 6
"""Coefficients of the polynomial in a cell."""


class Shape(NamedTuple):
    """The plectrum's shape at q; all of one shape, 1."""

    x: Floats
    """x/s."""
    z: Floats
    """z/s."""
    along: Floats
    """Force on the string along x, over F: -sin theta - mu cos theta."""
    up: Floats
    """Force on the string along z, over F: cos theta - mu sin theta."""


class Table(NamedTuple):
    """Local polynomials of one friction."""

    friction: float
    """1."""
    q_max: float
    """1, of the last cell's end."""
    coefficients: Floats
    """1, shape (ORDER, 4, CELLS): powers from 0, fields of `Shape`, cells."""

    def shape(self, q: Floats) -> Shape:
        """Return the shape at loads q [1]."""
        return self._of(q, slopes=False)[0]

    def shape_and_slope(self, q: Floats) -> tuple[Shape, Shape]:
        """Return the shape at loads q [1] and its derivative by q."""
        return self._of(q, slopes=True)

    def _of(self, q: Floats, slopes: bool) -> tuple[Shape, Shape]:
        place = q * (CELLS / self.q_max)
        cell = np.minimum(place.astype(np.intp), CELLS - 1)
        t = place - cell - 0.5
        c = self.coefficients.take(cell, axis=2)
        value, slope = c[-1], None
        for power in range(ORDER - 2, -1, -1):
            if slopes:
                slope = value if slope is None else slope * t + value
            value = value * t + c[power]
        if slope is None:
            return Shape(*value), Shape(*value)
        return Shape(*value), Shape(*(slope * (CELLS / self.q_max)))


@lru_cache(maxsize=128)
def table(friction: float) -> Table:
    """Return the table for a coefficient of friction [1], 0 to 0.5."""
    unit = Elastica(
        Plectrum.model_construct(
            length=1.0, width=12.0, thickness=1.0, youngs_modulus=1.0, friction=float(friction)
        )
    )
    q_max = float(unit.force_limit(1.0))
    nodes = np.cos(np.pi * (np.arange(ORDER) + 0.5) / ORDER) / 2
    q = np.clip((np.arange(CELLS)[:, None] + 0.5 + nodes) * q_max / CELLS, 0, q_max)
    bend = unit.bend(np.ones_like(q), q)
    sine, cosine = np.sin(bend.theta), np.cos(bend.theta)
    values = np.stack(
        [bend.x, bend.z, -sine - friction * cosine, cosine - friction * sine]
    )  # (4, CELLS, ORDER)
    powers = np.vander(nodes, ORDER, increasing=True)
    coefficients = np.linalg.solve(powers, values[..., None])[..., 0]
    by_power = np.ascontiguousarray(np.moveaxis(coefficients, -1, 0), dtype=float)
    return Table(float(friction), q_max, by_power)


class TabledElastica:
    """The exact plectrum of uniform section from its table; positions and forces unchecked."""

    def __init__(self, plectrum: Elastica):
        self.length = plectrum.length
        self.friction = plectrum.friction
        self.bending_stiffness = plectrum.bending_stiffness
        self._table = table(plectrum.friction)
        self._lean = np.arctan(plectrum.friction)

    def bend(self, s: ArrayLike, force: ArrayLike) -> Bend:
        """Return the contact point for positions s [m] and forces F [N]."""
        s, force = np.broadcast_arrays(np.asarray(s, float), np.asarray(force, float))
        q_f = s * s / self.bending_stiffness
        q = force * q_f
        q_s = 2 * force * s / self.bending_stiffness
        at, by_q = self._table.shape_and_slope(q)
        theta = np.arctan2(-at.along, at.up) - self._lean
        turned = at.along * by_q.up - at.up * by_q.along
        theta_q = turned / (1 + self.friction**2)
        return Bend(
            s * at.x,
            s * at.z,
            theta,
            at.x + s * by_q.x * q_s,
            at.z + s * by_q.z * q_s,
            theta_q * q_s,
            s * by_q.x * q_f,
            s * by_q.z * q_f,
            theta_q * q_f,
        )

    def force_limit(self, s: ArrayLike) -> Floats:
        """Return the force [N] that turns the tangent at s [m] by 90 degrees, or just less."""
        s = np.minimum(np.asarray(s, float), self.length)
        return self._table.q_max * self.bending_stiffness / s**2
