"""Large rotation of a uniform cantilever under a load normal to its deformed surface.

With xi = s sqrt(F / EI) the tangent's angle, counted from the load towards the clamp,
obeys psi'' = cos psi, psi(0) = psi'(0) = 0. Then theta = -psi(xi), and the contact point
follows by rotating the integrals of cos psi and sin psi by theta. All of it is a function
of the one number q = xi^2 = F s^2 / EI, smooth in q, so one table serves every s, F, E and
section.
"""

from functools import cache

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.typing import ArrayLike

from analysis.model.plectrum.base import Bend, Floats
from rig.schema import Plectrum

Q_MAX = 3.43
"""1, largest load q that is tabulated: the tangent has turned by 90 degrees at 3.4376."""


@cache
def _table() -> tuple[Chebyshev, Chebyshev, Chebyshev]:
    """Return x/s, z/(s q) and theta/q as Chebyshev series in q on [0, Q_MAX]."""
    from scipy.integrate import solve_ivp

    degree = 40
    nodes = np.sort((1 - np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))) / 2 * Q_MAX)
    xi = np.sqrt(nodes)

    def right(_, y):
        # psi, psi' (which is also the integral of cos psi), integral of sin psi
        return [y[1], np.cos(y[0]), np.sin(y[0])]

    solution = solve_ivp(right, (0, xi[-1]), [0, 0, 0], "DOP853", t_eval=xi, rtol=1e-13, atol=1e-16)
    psi, cosines, sines = solution.y
    x = (np.cos(psi) * cosines + np.sin(psi) * sines) / xi
    z = (np.cos(psi) * sines - np.sin(psi) * cosines) / xi / nodes
    fit = [
        Chebyshev.fit(nodes, values, degree, domain=[0, Q_MAX]) for values in (x, z, -psi / nodes)
    ]
    return fit[0].trim(1e-15), fit[1].trim(1e-15), fit[2].trim(1e-15)


class Elastica:
    """The exact plectrum of uniform section."""

    def __init__(self, plectrum: Plectrum):
        self.length = plectrum.length
        self.bending_stiffness = plectrum.bending_stiffness

    def bend(self, s: ArrayLike, force: ArrayLike) -> Bend:
        """Return the contact point for positions s [m] and forces F [N]."""
        s, force = np.broadcast_arrays(np.asarray(s, float), np.asarray(force, float))
        x_table, z_table, theta_table = _table()
        q = force * s**2 / self.bending_stiffness
        q_s = 2 * force * s / self.bending_stiffness
        q_f = s**2 / self.bending_stiffness
        x, dx = x_table(q), x_table.deriv()(q)
        z = z_table(q)
        dz = z + q * z_table.deriv()(q)
        z = q * z
        theta = theta_table(q)
        dtheta = theta + q * theta_table.deriv()(q)
        return Bend(
            s * x,
            s * z,
            q * theta,
            x + s * dx * q_s,
            z + s * dz * q_s,
            dtheta * q_s,
            s * dx * q_f,
            s * dz * q_f,
            dtheta * q_f,
        )

    def force_limit(self, s: ArrayLike) -> Floats:
        """Return the force [N] that turns the tangent at s [m] by 90 degrees."""
        return Q_MAX * self.bending_stiffness / np.asarray(s, float) ** 2
