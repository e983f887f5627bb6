"""Large rotation of a uniform cantilever under a load that follows its deformed surface.

Seen from the loaded point, the tangent's angle psi at an arc length xi sqrt(EI / F) towards
the clamp obeys the balance of moments psi'' = cos psi + mu sin psi, psi(0) = psi'(0) = 0:
F is normal to the surface at psi = 0 and mu F, the friction of a string that slides
towards the tip, lies along it. (That is sqrt(1 + mu^2) cos(psi - delta) with tan delta = mu:
one load, inclined by delta.) With xi = s sqrt(F / EI) then theta = -psi(xi), and the contact
point follows by rotating the integrals of cos psi and sin psi by theta. psi is even in xi, so
all of it is smooth in the one number q = xi^2 = F s^2 / EI: for each mu one table serves
every s, F, E and section.
"""

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.polynomial.chebyshev import chebpts1

from sautereau.analysis.model.plectrum.base import Bend, Floats
from sautereau.analysis.model.plectrum.cantilever import Cantilever, similar
from sautereau.rig.instrument import Plectrum

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

Q_MAX = 3.43
"""Dimensionless; largest tabulated load q without friction: the tangent has turned by 90
degrees at 3.4376."""
DEGREE = 40
"""Degree of the Chebyshev series through the integrated elastica. The table is computed from it."""
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

    Both are called with loads q of any shape and return shape (..., 3). In each cell the
    polynomial passes through the values at Chebyshev's nodes, exact to rounding.

    Args:
        friction: Coefficient of friction between plectrum and string, 0 to 0.5.
    """
    from scipy.interpolate import PPoly

    edges = np.linspace(0.0, q_max(friction), CELLS + 1)
    nodes = (1 + chebpts1(ORDER)) / 2
    width = edges[1]
    values = np.stack([series(edges[:-1, None] + nodes * width) for series in _series(friction)])
    powers = np.vander(nodes)  # highest power first, as PPoly requires
    coefficients = np.linalg.solve(powers, values[..., None])[..., 0]  # (3, CELLS, ORDER)
    coefficients /= width ** np.arange(ORDER - 1, -1, -1)
    table = PPoly(np.ascontiguousarray(coefficients.transpose(2, 1, 0)), edges)
    return table, table.derivative()


def _quarter_turn(friction: float) -> float:
    """Return xi at psi = pi/2, from the first integral psi'^2 / 2 = sin psi + mu (1 - cos psi)."""
    from scipy.integrate import quad

    def slowness(root: float) -> float:
        # With psi = root^2 the integrand is smooth where psi' = 0.
        psi = root**2
        lever = np.sinc(psi / np.pi) + friction * psi / 2 * np.sinc(psi / 2 / np.pi) ** 2
        return 2 / np.sqrt(2 * lever)

    return quad(slowness, 0, np.sqrt(np.pi / 2), epsabs=0, epsrel=1e-13)[0]


def _series(friction: float) -> list[Chebyshev]:
    """Return x/s, z/(s q) and theta/q as Chebyshev series in q, from one integration."""
    from scipy.integrate import solve_ivp

    end = q_max(friction)
    nodes = (1 + chebpts1(DEGREE + 1)) / 2 * end
    xi = np.sqrt(nodes)

    def right(_, y):
        # psi, integral of cos psi, integral of sin psi; psi' is their load's lever.
        return [y[1] + friction * y[2], np.cos(y[0]), np.sin(y[0])]

    solution = solve_ivp(right, (0, xi[-1]), [0, 0, 0], "DOP853", t_eval=xi, rtol=1e-13, atol=1e-16)
    psi, cosines, sines = solution.y
    x = (np.cos(psi) * cosines + np.sin(psi) * sines) / xi
    z = (np.cos(psi) * sines - np.sin(psi) * cosines) / xi / nodes
    return [
        Chebyshev.fit(nodes, values, DEGREE, domain=[0, end]) for values in (x, z, -psi / nodes)
    ]
