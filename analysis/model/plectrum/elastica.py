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
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.polynomial.chebyshev import chebval

from sautereau.analysis.model.plectrum.base import Bend, Floats
from sautereau.analysis.model.plectrum.cantilever import Cantilever, similar
from sautereau.rig.instrument import Plectrum

Q_MAX = 3.43
"""1, largest load q that is tabulated without friction: the tangent has turned by 90 degrees
at 3.4376."""
DEGREE = 40
"""Of the Chebyshev series."""


class Series(NamedTuple):
    """Chebyshev series in q, which `scale` and `offset` bring from [0, q_max] to [-1, 1]."""

    coefficients: Floats
    """x/s, z/(s q), theta/q and their derivatives by q, shape (DEGREE + 1, 6)."""
    scale: float
    offset: float


class Elastica(Cantilever):
    """The exact plectrum of uniform section."""

    def __init__(self, plectrum: Plectrum):
        super().__init__(plectrum)
        self._q_max = q_max(self.friction)

    def _bend(self, s: Floats, force: Floats) -> Bend:
        q = force * s**2 / self.bending_stiffness
        series = _table(self.friction)
        x, z, theta, dx, dz, dtheta = chebval(q * series.scale + series.offset, series.coefficients)
        shape = (x, q * z, q * theta, dx, z + q * dz, theta + q * dtheta)
        return similar(s, force, self.bending_stiffness, shape)

    def _force_limit(self, s: Floats) -> Floats:
        return self._q_max * self.bending_stiffness / s**2


@lru_cache(maxsize=128)
def q_max(friction: float) -> float:
    """Return the largest load q that is tabulated: the tangent turns by just under 90 degrees."""
    return Q_MAX * (_quarter_turn(friction) / _quarter_turn(0.0)) ** 2


def _quarter_turn(friction: float) -> float:
    """Return xi at psi = pi/2, from the first integral psi'^2 / 2 = sin psi + mu (1 - cos psi)."""
    from scipy.integrate import quad

    def slowness(root: float) -> float:
        # With psi = root^2 the integrand is smooth where psi' = 0.
        psi = root**2
        lever = np.sinc(psi / np.pi) + friction * psi / 2 * np.sinc(psi / 2 / np.pi) ** 2
        return 2 / np.sqrt(2 * lever)

    return quad(slowness, 0, np.sqrt(np.pi / 2), epsabs=0, epsrel=1e-13)[0]


@lru_cache(maxsize=128)
def _table(friction: float) -> Series:
    """Return the table of one coefficient of friction, from one integration of the elastica."""
    from scipy.integrate import solve_ivp

    end = q_max(friction)
    nodes = np.sort((1 - np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))) / 2 * end)
    xi = np.sqrt(nodes)

    def right(_, y):
        # psi, integral of cos psi, integral of sin psi; psi' is their load's lever.
        return [y[1] + friction * y[2], np.cos(y[0]), np.sin(y[0])]

    solution = solve_ivp(right, (0, xi[-1]), [0, 0, 0], "DOP853", t_eval=xi, rtol=1e-13, atol=1e-16)
    psi, cosines, sines = solution.y
    x = (np.cos(psi) * cosines + np.sin(psi) * sines) / xi
    z = (np.cos(psi) * sines - np.sin(psi) * cosines) / xi / nodes
    fit = [Chebyshev.fit(nodes, values, DEGREE, domain=[0, end]) for values in (x, z, -psi / nodes)]
    columns = [series.coef for series in (*fit, *(series.deriv() for series in fit))]
    coefficients = np.zeros((DEGREE + 1, len(columns)))
    for column, values in enumerate(columns):
        coefficients[: len(values), column] = values
    offset, scale = fit[0].mapparms()
    return Series(coefficients, float(scale), float(offset))
