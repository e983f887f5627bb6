"""The plectrum as an elastica under a string that slides on it, with friction.

A uniform cantilever of bending stiffness EI is loaded at the arc length s by a force F normal to
its deformed mid-line and a friction T F along it towards the tip, where |T| <= mu. With psi the
angle of the tangent relative to that under the load, as a function of xi = sigma sqrt(F / EI),
sigma from the load to the clamp, the moment's derivative (Love, A Treatise on the Mathematical
Theory of Elasticity, art. 262) gives psi'' = cos psi + T sin psi, psi(0) = psi'(0) = 0. All shapes
are functions of w = xi^2 alone: theta = psi(xi), X = s A(w), depth = s B(w), with
A = (cos theta C + sin theta S) / xi, B = (sin theta C - cos theta S) / xi, C and S the integrals
of cos psi and sin psi.

A carved plectrum has a straight top and a bottom of straight pieces. Its stiffness EI(x) and the
slope of its mid-line vary, so that its shapes depend on the place s as well. They are those of the
line half the clamp's thickness below the top, so that the wire's offset is that of a uniform one.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.polynomial import chebyshev
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from .compiled import entry
from .conditions import Choir

W_MAX = 2.5  # Largest w of the polynomials: the tangent under the load then is at about 1 rad
DEGREE = 14
PLACES = 8  # At which a carved plectrum is solved, for polynomials of one degree less
OUTER = 1.02  # Outermost of them over the length; the tip's slope continues beyond the tip


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
    return np.array([_fitted(unit, row, DEGREE) for row in (psi / nodes, a, b / a / nodes)])


def _fitted(unit, values, degree):
    """Fit ``values`` at ``unit`` from -1 to 1; return ascending powers of (unit + 1) / 2."""
    fitted = chebyshev.cheb2poly(chebyshev.chebfit(unit, values, degree))
    powers = np.polynomial.Polynomial(fitted)(np.polynomial.Polynomial([-1.0, 2.0])).coef
    return np.pad(powers, (0, degree + 1 - len(powers)))  # numpy drops highest powers that are 0


def inner_place(c: Choir) -> float:
    """Return the innermost place of `table`, m: on the carving's last piece."""
    return c.length * max(0.7, c.carving[-2][0] if c.carving else 0.0)


def table(c: Choir) -> np.ndarray:
    """Return the polynomials of `shape` by T and place; shape (4, places' powers, 3, DEGREE + 1).

    The first axis has the powers of T from -mu to mu, as a fraction; without friction the power 0
    alone. The second has those of the place from `inner_place` to OUTER times the length, as a
    fraction; for a uniform plectrum the power 0 alone. w is F s^2 / `Choir.equivalent_stiffness`.
    """
    if c.friction == 0:
        return _at_friction(c, 0.0)[None]
    unit = np.linspace(-1, 1, 4)
    tables = np.array([_at_friction(c, float(c.friction * each)) for each in unit])
    powers = [_fitted(unit, column, 3) for column in tables.reshape(4, -1).T]
    return np.ascontiguousarray(np.transpose(powers)).reshape(tables.shape)


def _at_friction(c, friction):
    if not c.carving:
        return shape(friction)[None]
    stiffness = c.equivalent_stiffness / c.bending_stiffness
    inner = inner_place(c) / c.length
    return _carved_table(friction, c.carving, c.thickness / c.length, stiffness, inner)


@lru_cache(maxsize=64)
def _carved_table(friction, carving, thickness, stiffness, inner):
    """Lengths are over that of the plectrum, ``stiffness`` is the equivalent over the clamp's."""
    unit = np.cos(np.pi * (np.arange(PLACES) + 0.5) / PLACES)
    loads = np.cos(np.pi * (np.arange(60) + 0.5) / 60)
    w = (loads + 1) / 2 * W_MAX
    shapes = []
    for place in inner + (unit + 1) / 2 * (OUTER - inner):
        theta, x, depth = _carved_shape(friction, carving, thickness, stiffness, place, w)
        rows = (theta / w, x / place, depth / x / w)
        shapes.append([_fitted(loads, row, DEGREE) for row in rows])
    flat = np.reshape(shapes, (PLACES, -1))
    powers = np.array([_fitted(unit, column, PLACES - 1) for column in flat.T])
    return np.ascontiguousarray(powers.T.reshape(PLACES, 3, DEGREE + 1))


def _carved_shape(friction, carving, thickness, stiffness, place, w):
    """Return theta, x and depth of the line below the top at a place, for each w."""
    force = w / place**2 * stiffness  # over that of the clamp's EI and of the plectrum's length
    state = np.zeros((4, len(w)))
    end = place
    for (x0, t0), (x1, t1) in reversed(list(pairwise(carving))):
        if end <= x0:
            continue
        rate = (t1 - t0) / (x1 - x0)
        slope = np.arctan(-rate * thickness / 2)  # of the mid-line, upwards: the bottom rises

        def back(x, y, x0=x0, t0=t0, rate=rate, slope=slope):
            turn, moment, _, _ = y.reshape(4, -1)
            psi = turn + slope
            bent = moment / (t0 + rate * (x - x0)) ** 3
            pull = force * (np.cos(psi) + friction * np.sin(psi))
            # towards the clamp, per x: the mid-line is longer by its slope
            return -np.concatenate([bent, pull, np.cos(psi), np.sin(psi)]) / np.cos(slope)

        solved = solve_ivp(back, (end, x0), state.ravel(), "DOP853", rtol=1e-11, atol=1e-14)
        state = solved.y[:, -1].reshape(4, -1)
        if end == place:
            at_place = t0 + rate * (place - x0)
        end = x0
    theta, _, c, s = state
    raised = (1 - at_place) * thickness / 2  # of the mid-line over the line, along the section
    x = np.cos(theta) * c + np.sin(theta) * s - raised * np.sin(theta)
    return theta, x, np.sin(theta) * c - np.cos(theta) * s + raised * np.cos(theta)


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


@entry
def shapes_at(table, inner, length, place, drag, shapes):
    """Write the polynomials of `table` at a place (m) into ``shapes``; shape (3, DEGREE + 1).

    Args:
        drag: T / mu.
    """
    v = (drag + 1) / 2
    u = (min(max(place, inner), OUTER * length) - inner) / (OUTER * length - inner)
    for i in range(shapes.shape[0]):
        for j in range(shapes.shape[1]):
            value = 0.0
            for q in range(table.shape[0] - 1, -1, -1):
                along = 0.0
                for k in range(table.shape[1] - 1, -1, -1):
                    along = along * u + table[q, k, i, j]
                value = value * v + along
            shapes[i, j] = value


@entry
def solve_place(table, inner, length, shapes, x, z, offset, w, place, drag):
    """Solve as `solve_contact` with the shapes of `table` at the place found.

    Args:
        table: Polynomials.
        inner, length: m, `inner_place` and the plectrum's length.
        shapes: Overwritten by the polynomials at the place; shape (3, DEGREE + 1).
        x, z, offset, w: As for `solve_contact`.
        place: First guess of s, m.
        drag: T / mu.
    """
    theta = 0.0
    for _ in range(20):
        shapes_at(table, inner, length, place, drag, shapes)
        before = place
        w, place, theta = solve_contact(shapes, x, z, offset, w)
        if table.shape[1] == 1 or abs(place - before) < 1e-13:
            break
    return w, place, theta


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


def static_pluck(c: Choir, points: int = 400, sticks: bool = True) -> StaticPluck:
    """Return the equilibria of a string of static stiffness on a plectrum, up to its release.

    The load w is the parameter: for each, s or T follows from the horizontal equilibrium
    K (x - x0) = F (sin theta - T cos theta), x = s A + e sin theta, by bisection, the height from
    the vertical one. The string sticks where it is as long as that needs |T| <= mu. The release is
    where s = length, or where the height no longer increases.

    Args:
        c: Plectrum and string, whose stiffness is the same in both directions.
        points: Number of equilibria.
        sticks: False for friction that points to the tip from the first contact on.

    Raises:
        ValueError: The plectrum bends further than the elastica's table, or the string leaves
            the last piece of its carving.
    """
    powers, inner = table(c), inner_place(c)
    shapes = np.empty(powers.shape[2:])
    x0 = c.length - c.overlap

    def shaped(w, s, drag):
        shapes_at(powers, inner, c.length, s, drag, shapes)
        t, a, r = (_value_and_slope(row, w)[0] for row in shapes)
        return t * w, a, r, c.equivalent_stiffness * w / s**2

    def horizontal(s, w, drag):
        theta, a, _, force = shaped(w, s, drag)
        across = np.sin(theta) - c.friction * drag * np.cos(theta)
        return s * a + c.offset * np.sin(theta) - x0 - force * across / c.string_stiffness

    def sliding(w, drag):
        return brentq(horizontal, 0.3 * x0, 3 * c.length, (w, drag), xtol=1e-14)

    def state(w, stuck):
        s, drag = sliding(w, 1.0), 1.0
        if s < stuck and c.friction > 0:
            s, drag = sliding(w, -1.0), -1.0
            if s > stuck:
                s, drag = stuck, brentq(lambda t: horizontal(stuck, w, t), -1, 1, xtol=1e-13)
        theta, a, r, force = shaped(w, s, drag)
        load = force * (np.cos(theta) + c.friction * drag * np.sin(theta))
        lift = load / c.string_stiffness
        return s, load, lift + s * a * r * w - c.offset * (np.cos(theta) - 1)

    if sliding(W_MAX, 1.0) < c.length:
        raise ValueError(
            "the string stays on the plectrum beyond the range of the elastica's table"
        )
    last = brentq(lambda w: sliding(w, 1.0) - c.length, 1e-12, W_MAX, xtol=1e-13)
    states = [(x0, 0.0, 0.0)]
    for w in last * np.linspace(0, 1, points)[1:]:
        states.append(state(w, states[-1][0] if sticks else -np.inf))
    rows = np.array(states)
    if c.carving and np.min(rows[:, 0]) < inner:
        raise ValueError("the string lies on the carving's last piece only for a part of the pluck")
    top = int(np.argmax(rows[:, 2]))
    rows = rows[: top + 1]
    return StaticPluck(rows[:, 2], rows[:, 1], rows[:, 0])
