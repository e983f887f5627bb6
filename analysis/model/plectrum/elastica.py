"""Large rotation of a uniform cantilever under a load that follows its deformed surface.

Seen from the loaded point, the tangent's angle psi at an arc length xi sqrt(EI / F) towards
the clamp obeys the balance of moments psi'' = cos psi + mu sin psi, psi(0) = psi'(0) = 0:
F is normal to the surface at psi = 0 and mu F, the friction of a string that slides
towards the tip, lies along it. (That is sqrt(1 + mu^2) cos(psi - delta) with tan delta = mu:
one load, inclined by delta.) With xi = s sqrt(F / EI) then theta = -psi(xi), and the contact
point follows by rotating the integrals of cos psi and sin psi by theta. psi is even in xi, so
all of it is smooth in the one number q = xi^2 = F s^2 / EI: for each mu one table serves
every s, F, E and section. It is as smooth in mu: one integration serves every friction.
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
"""Dimensionless; largest tabulated load q without friction: the tangent has turned by 90
degrees at 3.4376."""
DEGREE = 40
"""Degree in q of the Chebyshev series through the integrated elastica."""
FRICTION_DEGREE = 15
"""Degree in mu of that series."""
CELLS = 128
"""Equal cells of the table over q."""
ORDER = 6
"""Coefficients of the polynomial in a cell."""


class Elastica(Cantilever):
    """The exact plectrum of uniform section."""

    def __init__(self, plectrum: Plectrum):
        super().__init__(plectrum)
        self._q_max = q_max(self.friction)

    def _bend(self, s: Floats, force: Floats) -> Bend:
        q = force * s**2 / self.bending_stiffness
        fields = (np.moveaxis(table(q), -1, 0) for table in elastica_tables(self.friction))
        (x, z, theta), (dx, dz, dtheta) = fields
        shape = (x, q * z, q * theta, dx, z + q * dz, theta + q * dtheta)
        return similar(s, force, self.bending_stiffness, shape)

    def _force_limit(self, s: Floats) -> Floats:
        return self._q_max * self.bending_stiffness / s**2


@lru_cache(maxsize=128)
def q_max(friction: float) -> float:
    """Return the largest load q that is tabulated: the tangent turns by just under 90 degrees."""
    return Q_MAX * (_quarter_turn(friction) / _quarter_turn(0.0)) ** 2


@lru_cache(maxsize=128)
def elastica_tables(friction: float) -> "tuple[PPoly, PPoly]":
    """Return x/s, z/(s q) and theta/q as polynomials of q, and their derivatives by q.

    Both are called with loads q of any shape and return shape (..., 3).

    Args:
        friction: Coefficient of friction between plectrum and string, 0 to 0.5.
    """
    from scipy.interpolate import PPoly

    end = q_max(friction)
    (at,) = _chebyshev(friction / FRICTION_MAX, FRICTION_DEGREE)
    cells = np.tensordot(at, _cells(), 1)
    cells /= end ** np.arange(ORDER - 1, -1, -1)[:, None, None]
    table = PPoly(cells, np.linspace(0.0, end, CELLS + 1))
    return table, table.derivative()


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


def _chebyshev(share: ArrayLike, degree: int) -> Floats:
    """Return Chebyshev's polynomials of a number from 0 to 1; shape (n, degree + 1)."""
    return np.asarray(chebvander(2 * np.asarray(share, float) - 1, degree), float)


@lru_cache(maxsize=1)
def _cells() -> Floats:
    """Return the polynomials of q / q_max in each cell, as Chebyshev series in mu.

    Shape (`FRICTION_DEGREE` + 1, `ORDER`, `CELLS`, 3): the highest power first, as PPoly requires.
    """
    from scipy.integrate import solve_ivp

    shares, nodes = ((1 + chebpts1(degree + 1)) / 2 for degree in (FRICTION_DEGREE, DEGREE))
    friction = shares * FRICTION_MAX
    end = np.array([q_max(mu) for mu in friction.tolist()])

    def right(_, y):
        # psi, integral of cos psi, integral of sin psi; psi' is their load's lever.
        psi, cosines, sines = y.reshape(3, -1)
        rates = cosines + friction * sines, np.cos(psi), np.sin(psi)
        return np.ravel(np.sqrt(end) * rates)

    at, start = np.sqrt(nodes), np.zeros(3 * len(friction))
    solution = solve_ivp(right, (0, at[-1]), start, "DOP853", t_eval=at, rtol=1e-13, atol=1e-16)
    psi, cosines, sines = solution.y.reshape(3, len(friction), len(nodes))
    q = end[:, None] * nodes
    x = (np.cos(psi) * cosines + np.sin(psi) * sines) / np.sqrt(q)
    z = (np.cos(psi) * sines - np.sin(psi) * cosines) / np.sqrt(q) / q
    laws = np.stack([x, z, -psi / q])
    # In each cell the polynomial passes through the series at Chebyshev's nodes.
    within = (1 + chebpts1(ORDER)) / 2
    places = (np.arange(CELLS) + within[:, None]) / CELLS
    to_cells = _chebyshev(places, DEGREE) @ np.linalg.inv(_chebyshev(nodes, DEGREE))
    to_powers = np.linalg.inv(np.vander(within)) * CELLS ** np.arange(ORDER - 1.0, -1, -1)[:, None]
    to_friction = np.linalg.inv(_chebyshev(shares, FRICTION_DEGREE))
    return np.einsum("fg,po,ocn,lgn->fpcl", to_friction, to_powers, to_cells, laws, optimize=True)
