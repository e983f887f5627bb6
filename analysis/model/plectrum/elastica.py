"""Large rotation of a uniform cantilever under a load that follows its deformed surface.

Seen from the loaded point, the tangent's angle psi at an arc length xi sqrt(EI / F) towards
the clamp obeys the balance of moments psi'' = cos psi + T sin psi, psi(0) = psi'(0) = 0:
F is normal to the surface at psi = 0 and the drag T F, the friction of the string, lies along it.
(That is sqrt(1 + T^2) cos(psi - delta) with tan delta = T: one load, inclined by delta.) With
xi = s sqrt(F / EI) then theta = -psi(xi), and the contact point follows by rotating the integrals
of cos psi and sin psi by theta. psi is even in xi, so all of it is smooth in the one number
q = xi^2 = F s^2 / EI: for each T one table serves every s, F, E and section. It is as smooth in T:
one integration serves every drag.
"""

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.chebyshev import chebpts1, chebvander
from numpy.typing import ArrayLike

from sautereau.analysis.model.plectrum.base import Bend, Floats
from sautereau.analysis.model.plectrum.cantilever import FRICTION_MAX, Cantilever, similar
from sautereau.rig.instrument import Plectrum

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

Q_MAX = 3.43
"""Dimensionless; largest load q without friction: the tangent has turned by 90 degrees at
3.4376."""
DEGREE = 40
"""Degree in q of the Chebyshev series through the integrated elastica."""
DRAG_DEGREE = 12
"""Degree in T of the table."""
STICKING_DEGREE = 5
"""Degree in T of the table of a string that sticks, over a smaller range of T."""
CELLS = 128
"""Equal cells of the table over q."""
ORDER = 6
"""Coefficients of the polynomial in a cell."""


class Elastica(Cantilever):
    """The exact plectrum of uniform section."""

    def __init__(self, plectrum: Plectrum):
        super().__init__(plectrum)
        self._q_max = q_max(self.friction)

    def _bend(self, s: Floats, force: Floats, drag: Floats) -> Bend:
        q = force * s**2 / self.bending_stiffness
        if drag.size and np.all(drag == drag.flat[0]):
            fields = [table(q) for table in elastica_tables(float(drag.flat[0]))]
        else:
            basis = _chebyshev(drag, DRAG_DEGREE)[..., None, :]
            fields = [(basis @ table(q))[..., 0, :] for table in _all_tables()]
        (x, z, theta), (dx, dz, dtheta) = (np.moveaxis(field, -1, 0) for field in fields)
        shape = (x, q * z, q * theta, dx, z + q * dz, theta + q * dtheta)
        return similar(s, force, self.bending_stiffness, shape)

    def _force_limit(self, s: Floats) -> Floats:
        return self._q_max * self.bending_stiffness / s**2


@lru_cache(maxsize=128)
def q_max(friction: float) -> float:
    """Return the largest load q at this friction: the tangent turns by just under 90 degrees."""
    return Q_MAX * (_quarter_turn(friction) / _quarter_turn(0.0)) ** 2


@lru_cache(maxsize=128)
def elastica_tables(drag: float) -> "tuple[PPoly, PPoly]":
    """Return x/s, z/(s q) and theta/q as polynomials of q, and their derivatives by q.

    Both are called with loads q of any shape and return shape (..., 3).

    Args:
        drag: Force along the surface towards the tip over the one normal to it, at most 0.5 either
            way.
    """
    table = _table(_chebyshev(drag, DRAG_DEGREE)[0])
    return table, table.derivative()


@lru_cache(maxsize=1)
def _all_tables() -> "tuple[PPoly, PPoly]":
    """Return the tables of all terms of the series in T, and their derivatives by q."""
    table = _table(np.eye(DRAG_DEGREE + 1))
    return table, table.derivative()


@lru_cache(maxsize=128)
def sticking_table(friction: float) -> "PPoly":
    """Return x/s, z/(s q) and theta/q of a string that sticks, as polynomials of q.

    It is called with loads q of any shape and returns shape (..., `STICKING_DEGREE` + 1, 3): the
    coefficients of the powers of drag over friction, the lowest first.
    """
    nodes = chebpts1(STICKING_DEGREE + 1)
    powers = np.linalg.inv(np.vander(nodes, increasing=True))
    return _table(powers @ _chebyshev(friction * nodes, DRAG_DEGREE))


def _table(weights: Floats) -> "PPoly":
    """Return weighted sums of the table's series in T; `weights` of shape (..., terms)."""
    from scipy.interpolate import PPoly

    cells = np.moveaxis(np.tensordot(weights, _cells(), 1), (-3, -2), (0, 1))
    return PPoly(np.ascontiguousarray(cells), np.linspace(0.0, Q_MAX, CELLS + 1))


@lru_cache(maxsize=128)
def _quarter_turn(friction: float) -> float:
    """Return xi at psi = pi/2, from the first integral psi'^2 / 2 = sin psi + mu (1 - cos psi)."""
    from scipy.integrate import quad

    def slowness(root: float) -> float:
        # With psi = root^2 the integrand is smooth where psi' = 0.
        psi = root**2
        lever = np.sinc(psi / np.pi) + friction * psi / 2 * np.sinc(psi / 2 / np.pi) ** 2
        return 2 / np.sqrt(2 * lever)

    return quad(slowness, 0, np.sqrt(np.pi / 2), epsabs=0, epsrel=1e-13)[0]


def _chebyshev(drag: ArrayLike, degree: int) -> Floats:
    """Return Chebyshev's polynomials of drags up to `FRICTION_MAX`; shape (..., degree + 1)."""
    return np.asarray(chebvander(np.asarray(drag, float) / FRICTION_MAX, degree), float)


@lru_cache(maxsize=1)
def _cells() -> Floats:
    """Return the polynomials of q in each cell, as Chebyshev series in T.

    Shape (`DRAG_DEGREE` + 1, `ORDER`, `CELLS`, 3): the highest power first, as PPoly requires.
    """
    from scipy.integrate import solve_ivp

    drag = chebpts1(DRAG_DEGREE + 1) * FRICTION_MAX
    nodes = (1 + chebpts1(DEGREE + 1)) / 2

    def right(_, y):
        # psi, integral of cos psi, integral of sin psi; psi' is their load's lever.
        psi, cosines, sines = y.reshape(3, -1)
        return np.ravel([cosines + drag * sines, np.cos(psi), np.sin(psi)])

    at, start = np.sqrt(Q_MAX * nodes), np.zeros(3 * len(drag))
    solution = solve_ivp(right, (0, at[-1]), start, "DOP853", t_eval=at, rtol=1e-13, atol=1e-16)
    psi, cosines, sines = solution.y.reshape(3, len(drag), len(nodes))
    q = Q_MAX * nodes
    x = (np.cos(psi) * cosines + np.sin(psi) * sines) / np.sqrt(q)
    z = (np.cos(psi) * sines - np.sin(psi) * cosines) / np.sqrt(q) / q
    laws = np.stack([x, z, -psi / q])
    # In each cell the polynomial passes through the series at Chebyshev's nodes.
    within = (1 + chebpts1(ORDER)) / 2
    places = (np.arange(CELLS) + within[:, None]) / CELLS
    series = [np.asarray(chebvander(2 * share - 1, DEGREE), float) for share in (places, nodes)]
    to_cells = series[0] @ np.linalg.inv(series[1])
    to_powers = np.linalg.inv(np.vander(within, increasing=False))
    to_powers *= (CELLS / Q_MAX) ** np.arange(ORDER - 1.0, -1, -1)[:, None]
    to_drag = np.linalg.inv(_chebyshev(drag, DRAG_DEGREE))
    return np.einsum("fg,po,ocn,lgn->fpcl", to_drag, to_powers, to_cells, laws, optimize=True)
