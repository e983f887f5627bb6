"""Independent solution of the pluck of `docs/model.md`, to judge the package's own.

It is written from the document alone, shares no code with the package, and integrates the
elastica of the document numerically. `python -m tests.oracles.pluck` writes `plucks.csv`.

Symbols are the document's: s position of the string on the plectrum, F normal force, T friction
over normal force, a angle by which the surface at s points down, u and w displacement of the
string outwards and upwards, h height of the jack since first contact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, sin

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.polynomial.chebyshev import chebpts1
from scipy.optimize import brentq

from tests.oracles.elastica import Bar, State
from tests.oracles.outline import Outline


@dataclass(frozen=True)
class Release:
    """Release of the string and the pluck before it. SI units."""

    height: float
    force: float
    lift: float
    shift: float
    angle: float
    position: float
    at: str
    """`tip`, or `fold`: at the greatest height before the tip."""
    work: float
    """Integral of the force on the jack over its height."""
    string_energy: float
    bending_energy: float
    friction_loss: float
    """Integral of T F over the position s."""
    offset_work: float
    """Integral of T F times the string's distance from the mid-line over the rotation: work that
    the document's elastica loses or gains, because friction acts at the mid-line there."""
    first_position: float
    phases: tuple[Phase, ...]
    curve: np.ndarray
    """Shape (n, 2): height of the jack in m, force on it in N, from contact to release."""


@dataclass(frozen=True)
class Phase:
    """One phase of friction; Chebyshev polynomials over a parameter from 0 to 1."""

    name: str
    height: Chebyshev
    force: Chebyshev
    friction: Chebyshev
    position: Chebyshev
    lift: Chebyshev
    rotation: Chebyshev
    end: float
    """Parameter at the end: below 1 at a fold."""

    def integral(self, integrand: Callable[..., np.ndarray], over: Chebyshev) -> float:
        """Integrate a function of the parameter over a quantity of the phase."""
        nodes, weights = np.polynomial.legendre.leggauss(80)
        p = self.end * (nodes + 1) / 2
        return float(np.sum(weights * integrand(p) * over.deriv()(p)) * self.end / 2)


class Pluck:
    """Equilibria of string and plectrum, and the three phases of friction."""

    def __init__(
        self, bar: Bar, *, overlap: float, stiffness: float, friction: float, nodes: int = 32
    ) -> None:
        """Take the overlap in m, the string's stiffness in N/m, the coefficient of friction and
        the number of equilibria per phase.
        """
        self.bar, self.stiffness, self.friction, self.nodes = bar, stiffness, friction, nodes
        self.length = bar.outline.length
        self.rest = self.length - overlap
        self.first, self.first_z = self._first_contact()
        probe = 1e-6 * bar.rigidity * (bar.outline.top(0) - bar.outline.bottom(0)) ** 3
        probe /= self.length**2
        self.scale = 0.5 * probe / bar.state(self.length, probe, 0.0).rotation
        """Force in N at the tip that turns it by about half a radian."""

    def _first_contact(self) -> tuple[float, float]:
        """Return position s_0 and height of the string's centre at first contact, in m.

        Where a rough surface has several, it is the highest.
        """

        def gap(s: float) -> float:
            return self.bar.state(s, 0.0, 0.0).x - self.rest

        reach = 2 * self.bar.radius + 0.02 * self.length
        grid = np.linspace(self.rest - reach, min(self.rest + reach, self.length), 60)
        near = [b for b in self.bar.outline.breaks if grid[0] < b < grid[-1]]
        grid = np.unique([*grid, *near, *(np.asarray(near) + 1e-9 * self.length)])
        gaps = [gap(float(s)) for s in grid]
        roots = [
            float(brentq(gap, lo, hi, xtol=1e-17))
            for lo, hi, a, b in zip(grid[:-1], grid[1:], gaps[:-1], gaps[1:], strict=True)
            if a <= 0 < b or a < 0 <= b
        ]
        heights = [self.bar.state(s, 0.0, 0.0).z for s in roots]
        best = int(np.argmax(heights))
        return roots[best], heights[best]

    def shift(self, state: State, force: float, friction: float) -> float:
        """Return the string's displacement u outwards, in m."""
        return force * (sin(state.angle) - friction * cos(state.angle)) / self.stiffness

    def lift(self, state: State, force: float, friction: float) -> float:
        """Return the string's displacement w upwards, in m."""
        return force * (cos(state.angle) + friction * sin(state.angle)) / self.stiffness

    def height(self, s: float, force: float, friction: float) -> float:
        """Return the height h of the jack in m."""
        state = self.bar.state(s, force, friction)
        return self.lift(state, force, friction) - state.z + self.first_z

    def gap(self, s: float, force: float, friction: float) -> float:
        """Return X - (L - overlap) - u in m: zero in equilibrium."""
        state = self.bar.state(s, force, friction)
        return state.x - self.rest - self.shift(state, force, friction)

    def force_beyond(self, s: float, lo: float, friction: float) -> float:
        """Return the next force above `lo` (N) at which the string is in equilibrium at s (m)."""
        first, step = lo, 0.05 * self.scale
        hi = lo + step
        while self.gap(s, hi, friction) > 0:
            lo, hi = hi, hi + step
            if hi > first + 20 * self.scale:
                raise ArithmeticError(f"no equilibrium at s = {s} m with T = {friction}")
        return float(brentq(lambda f: self.gap(s, f, friction), lo, hi, xtol=1e-16))

    def opens(self, s: float, force: float, friction: float) -> bool:
        """Return whether the gap is above 0 just above a force (N), at s in m."""
        return self.gap(s, force + 1e-4 * self.scale, friction) > 0

    def inward(self, force: float) -> float:
        """Return the position in m of a string that slides towards the clamp, force in N."""
        bracket = self.first - 0.15 * self.length, self.first * (1 + 1e-9)
        return float(brentq(lambda s: self.gap(s, force, -self.friction), *bracket, xtol=1e-17))

    def turning_force(self) -> float:
        """Return the force in N at which the position has its minimum."""

        def slope(force: float) -> float:
            s, d = self.inward(force), 2e-3 * force
            g = [self.gap(s, force + k * d, -self.friction) for k in (-2, -1, 1, 2)]
            return (g[0] - 8 * g[1] + 8 * g[2] - g[3]) / (12 * d)

        last = self.force_beyond(self.first, 1e-4 * self.scale, -self.friction)
        return float(brentq(slope, 0.02 * last, 0.98 * last, xtol=1e-9 * last))

    def sticking(self, s: float, force: float) -> float:
        """Return T at which the string is in equilibrium at s (m) under a force in N."""
        reach = self.friction + 0.2
        return float(brentq(lambda t: self.gap(s, force, t), -reach, reach, xtol=1e-16))

    def phases(self) -> list[Phase]:
        """Return the phases from first contact to release."""
        mu, phases = self.friction, []
        turn, stuck = 0.0, self.first
        if self.opens(stuck, 0.0, -mu):
            turn = self.turning_force()
            stuck = self.inward(turn)
            phases.append(self._phase("inward", lambda p: (self.inward(p * turn), p * turn, -mu)))
        slip = turn
        if self.opens(stuck, turn, mu):
            slip = self.force_beyond(stuck, turn + 1e-4 * self.scale, mu)

            def stick(p: float) -> tuple[float, float, float]:
                force = turn + p * (slip - turn)
                return stuck, force, self.sticking(stuck, force)

            phases.append(self._phase("stick", stick))

        start = self._start_of_slide(stuck, slip)

        def outward(p: float) -> tuple[float, float, float]:
            s = stuck + (self.length - stuck) * (start * p + (1 - start) * p**2)
            return s, self.force_beyond(s, slip, mu), mu

        phases.append(self._phase("outward", outward))
        return phases

    def _start_of_slide(self, s: float, force: float) -> float:
        """Return a coefficient b for which F is smooth in p, with s rising as b p + (1 - b) p^2.

        F nearly starts like a square root of s if friction is small: s is nearly a parabola of F.
        """
        mu, df, ds = self.friction, 1e-4 * self.scale, 1e-5 * self.length
        by_force = (self.gap(s, force + df, mu) - self.gap(s, force - df, mu)) / (2 * df)
        by_position = (self.gap(s, force, mu) - self.gap(s - ds, force, mu)) / ds
        rise = self.force_beyond(self.length, force, mu) - force
        return min(max(-by_force / by_position * rise / (self.length - s), 0.0), 1.0)

    def _phase(self, name: str, point: Callable[[float], tuple[float, float, float]]) -> Phase:
        nodes = (chebpts1(self.nodes) + 1) / 2
        rows = []
        for p in nodes:
            s, force, friction = point(float(p))
            state = self.bar.state(s, force, friction)
            lift = self.lift(state, force, friction)
            h = self.height(s, force, friction)
            rows.append((h, force, friction, s, lift, state.rotation))
        fits = [
            Chebyshev.fit(nodes, column, self.nodes - 1, domain=[0, 1])
            for column in zip(*rows, strict=True)
        ]
        slope, grid = fits[0].deriv(), np.linspace(0.02, 1, 200)
        falls = np.flatnonzero(slope(grid) < 0)
        end = 1.0
        if len(falls) and falls[0]:
            end = float(brentq(slope, grid[falls[0] - 1], grid[falls[0]], xtol=1e-15))
        return Phase(name, *fits, end)

    def release(self) -> Release:
        """Return the release and the pluck before it."""
        phases: list[Phase] = []
        for phase in self.phases():
            phases.append(phase)
            if phase.end < 1:
                break
        last = phases[-1]
        at = "fold" if last.end < 1 else "tip"
        if at == "tip":
            position, friction = self.length, self.friction
            force = self.force_beyond(position, float(last.force(0.0)), friction)
        else:
            position, force, friction = (
                float(f(last.end)) for f in (last.position, last.force, last.friction)
            )
        return self._release(phases, position, force, friction, at)

    def _release(
        self, phases: list[Phase], s: float, force: float, friction: float, at: str
    ) -> Release:
        state = self.bar.state(s, force, friction)
        lift, shift = self.lift(state, force, friction), self.shift(state, force, friction)
        work = loss = offset_work = 0.0
        curve = [[0.0, 0.0]]
        for phase in phases:
            work += self.stiffness * phase.integral(phase.lift, phase.height)
            loss += phase.integral(lambda p, f=phase: f.friction(p) * f.force(p), phase.position)
            offset_work += phase.integral(
                lambda p, f=phase: (
                    f.friction(p)
                    * f.force(p)
                    * (
                        np.array([self.bar.offset(float(x)) for x in f.position(p)])
                        + self.bar.radius
                    )
                ),
                phase.rotation,
            )
            p = np.linspace(0, phase.end, 25)[1:]
            curve += np.column_stack([phase.height(p), self.stiffness * phase.lift(p)]).tolist()
        return Release(
            self.height(s, force, friction),
            force,
            lift,
            shift,
            state.angle,
            s,
            at,
            work,
            self.stiffness * (lift**2 + shift**2) / 2,
            state.energy,
            loss,
            offset_work,
            self.first,
            tuple(phases),
            np.array(curve),
        )


def pluck(
    outline: Outline,
    *,
    modulus: float,
    width: float,
    overlap: float,
    stiffness: float,
    radius: float,
    friction: float = 0.0,
    contact: str = "surface",
    tolerance: float = 1e-12,
    nodes: int = 32,
    surface_moment: bool = False,
) -> Release:
    """Return the release of a string from a plectrum and the pluck before it.

    Args:
        outline: shape of the plectrum.
        modulus: Young's modulus in Pa.
        width: of the plectrum in m.
        overlap: from the string's centre at rest to the tip, in m.
        stiffness: of the string in N/m, see `string_stiffness`.
        radius: of the wire in m.
        friction: coefficient of friction, dimensionless.
        contact: `surface` or `mid-line`.
        tolerance: relative, of the integration.
        nodes: number of equilibria computed in each phase.
        surface_moment: whether the load acts at the surface (the document: at the mid-line).
    """
    bar = Bar(
        outline,
        modulus=modulus,
        width=width,
        radius=radius,
        contact=contact,
        tolerance=tolerance,
        surface_moment=surface_moment,
    )
    return Pluck(
        bar, overlap=overlap, stiffness=stiffness, friction=friction, nodes=nodes
    ).release()


def string_stiffness(tension: float, length: float, plucking_point: float) -> float:
    """Return the static stiffness in N/m; tension in N, lengths in m."""
    b = plucking_point / length
    return tension / (length * b * (1 - b))


if __name__ == "__main__":
    from tests.oracles.cases import write

    write()
