"""The plectrum as an elastica under a string that slides on it, with friction.

A uniform cantilever of bending stiffness EI is loaded at the arc length s by a force F normal to
its deformed mid-line and a friction mu F along it towards the tip. With psi the angle of the
tangent relative to that under the load, as a function of xi = sigma sqrt(F / EI), sigma from the
load to the clamp, the moment's derivative (Love, A Treatise on the Mathematical Theory of
Elasticity, art. 262) gives psi'' = cos psi + mu sin psi, psi(0) = psi'(0) = 0. All shapes are
functions of w = xi^2 alone: theta = psi(xi), X = s A(w), depth = s B(w), with
A = (cos theta C + sin theta S) / xi, B = (sin theta C - cos theta S) / xi, C and S the integrals
of cos psi and sin psi.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from .compiled import entry
from .conditions import Choir

W_MAX = 2.5  # Largest w of the polynomials: the tangent under the load then is at about 1 rad
DEGREE = 14


@lru_cache(maxsize=256)
def shape(friction: float) -> np.ndarray:
    """Return the polynomials in w of theta / w, A and (B / A) / w; shape (3, DEGREE + 1).

    Coefficients are in ascending powers of w / W_MAX.
    """
    nodes = (np.cos(np.pi * (np.arange(60) + 0.5) / 60) + 1) / 2 * W_MAX

    def slope(_, y):
        psi = y[0]
        return [y[1], np.cos(psi) + friction * np.sin(psi), np.cos(psi), np.sin(psi)]

    solved = solve_ivp(
        slope,
        (0, np.sqrt(W_MAX)),
        [0.0] * 4,
        "DOP853",
        np.sqrt(nodes[::-1]),
        rtol=1e-12,
        atol=1e-14,
    )
    psi, _, c, s = solved.y[:, ::-1]
    xi = np.sqrt(nodes)
    a = (np.cos(psi) * c + np.sin(psi) * s) / xi
    b = (np.sin(psi) * c - np.cos(psi) * s) / xi
    unit = 2 * nodes / W_MAX - 1
    rows = []
    for values in (psi / nodes, a, b / a / nodes):
        fitted = chebyshev.cheb2poly(chebyshev.chebfit(unit, values, DEGREE))
        shifted = np.polynomial.Polynomial(fitted)(np.polynomial.Polynomial([-1.0, 2.0]))
        rows.append(shifted.coef)
    return np.array(rows)


@entry
def _value_and_slope(row, w):
    u = w / W_MAX
    value = 0.0
    slope = 0.0
    for k in range(row.shape[0] - 1, -1, -1):
        slope = slope * u + value
        value = value * u + row[k]
    return value, slope / W_MAX


@entry
def solve_contact(shapes, x, z, offset, w):
    """Solve for the load of a wire's centre at (x, z) in the clamp's frame.

    Args:
        shapes: Polynomials of `shape`.
        x: m, from the clamp towards the tip.
        z: m, above the undeformed mid-line; below ``offset`` the plectrum is bent.
        offset: m, from the mid-line to the wire's centre.
        w: First guess of the dimensionless load.

    Returns:
        w, s (m), theta (rad): F = EI w / s^2.
    """
    theta = 0.0
    for _ in range(30):
        t, dt = _value_and_slope(shapes[0], w)
        r, dr = _value_and_slope(shapes[2], w)
        theta, dtheta = t * w, t + dt * w
        ratio, dratio = r * w, r + dr * w
        sine, cosine = np.sin(theta), np.cos(theta)
        g = (x - offset * sine) * ratio - offset * cosine + z
        dg = (
            (x - offset * sine) * dratio - offset * cosine * dtheta * ratio + offset * sine * dtheta
        )
        step = -g / dg
        w = min(max(w + step, 0.0), W_MAX)
        if abs(step) < 1e-12:
            break
    t, dt = _value_and_slope(shapes[0], w)
    theta = t * w
    a, _ = _value_and_slope(shapes[1], w)
    return w, (x - offset * np.sin(theta)) / a, theta


@dataclass(frozen=True)
class StaticPluck:
    """The quasi-static pluck as functions of the jack's height above contact; shape (n,) each."""

    height: np.ndarray
    """m, of the jack above contact, increasing to the release."""
    load: np.ndarray
    """N, vertical force on the jack."""
    position: np.ndarray
    """m, arc length from the clamp to the string."""

    @property
    def release_height(self) -> float:
        """m, at which the string leaves."""
        return float(self.height[-1])

    @property
    def release_force(self) -> float:
        """N, on the jack at release."""
        return float(self.load[-1])


def static_pluck(c: Choir, points: int = 400) -> StaticPluck:
    """Return the equilibria of a string of static stiffness on a plectrum, up to its release.

    The load w is the parameter: for each, s follows from the horizontal equilibrium
    K (x - x0) = F (sin theta - mu cos theta), x = s A + e sin theta, by bisection, the height from
    the vertical one. The release is where s = length, or where the height no longer increases.

    Args:
        c: Plectrum and string, whose stiffness is the same in both directions.
        points: Number of equilibria.

    Raises:
        ValueError: The plectrum bends further than the elastica's table.
    """
    shapes = shape(c.friction)
    x0 = c.length - c.overlap

    def state(w):
        t, _ = _value_and_slope(shapes[0], w)
        r, _ = _value_and_slope(shapes[2], w)
        a, _ = _value_and_slope(shapes[1], w)
        theta = t * w
        across = np.sin(theta) - c.friction * np.cos(theta)

        def horizontal(s):
            force = c.bending_stiffness * w / s**2
            return s * a + c.offset * np.sin(theta) - x0 - force * across / c.string_stiffness

        s = brentq(horizontal, 0.3 * x0, 3 * c.length, xtol=1e-14)
        force = c.bending_stiffness * w / s**2
        load = force * (np.cos(theta) + c.friction * np.sin(theta))
        lift = load / c.string_stiffness
        return s, load, lift + s * a * r * w - c.offset * (np.cos(theta) - 1)

    if state(W_MAX)[0] < c.length:
        raise ValueError(
            "the string stays on the plectrum beyond the range of the elastica's table"
        )
    last = brentq(lambda w: state(w)[0] - c.length, 1e-12, W_MAX, xtol=1e-13)
    rows = np.array([state(w) for w in last * np.linspace(0, 1, points)])
    top = int(np.argmax(rows[:, 2]))
    rows = rows[: top + 1]
    return StaticPluck(rows[:, 2], rows[:, 1], rows[:, 0])
