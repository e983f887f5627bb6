"""The equilibria of plectrum and spring string, for many cases at once.

The plectrum pushes the string with F along its surface's normal and T F along its tangent
towards the clamp; the string's drag on the plectrum is opposite and equal, and bends it too. In
the clamp's frame, with a = -theta the angle by which the plectrum is bent down, the string goes out
by F (sin a - T cos a) / K and up by F (cos a + T sin a) / K.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.pluck.loaded import Loaded, Plectra, Rows, Stuck

ROUNDING = 1e-15  # Residual over the lengths it is the difference of, below which it is rounding
LOADS = np.concatenate([[0.0], np.geomspace(1e-14, 1.0, 97)])
"""Fractions of the largest load, between which the load of a given position is bracketed."""
NEWTON_STEPS = 60
FEW = 5  # Points of a stretch from which the positions of the others are nearly known
AT_END = np.array([3, -16, 36, -48, 25]) / 12
"""Weights of the last five points of a stretch in its slope at the end, by backward differences of
order 4; the points are even in the load."""
STICKING_STEPS = 40  # Most iterations of the drag of a string that sticks; 4 to 6 are usual


@dataclass(frozen=True)
class Curve:
    """A stretch of equilibria; arrays of shape (cases, points), or (n,) of a single pluck."""

    load: Floats
    """F s^2, in the unit of the plectra."""
    height: Floats
    """m, of the jack above first contact."""
    force: Floats
    """N, normal to the plectrum's surface."""
    position: Floats
    """m, of the string along the plectrum, from the clamp."""
    angle: Floats
    """rad, by which the plectrum is bent down under the string."""
    lift: Floats
    """m, of the string, upwards."""
    shift: Floats
    """m, of the string, outwards along the plectrum."""
    drag: Floats
    """Force along the surface towards the clamp over the one normal to it, dimensionless."""

    @property
    def string_force(self) -> Floats:
        """N, between string and plectrum: the resultant of normal force and friction."""
        return self.force * np.hypot(1.0, self.drag)


class Equilibria:
    """Plectra and their spring strings."""

    def __init__(self, plectra: Plectra, stiffness: Floats, overlap: Floats):
        """Take the string's stiffness K [N/m] and the overlap [m], each of shape (cases,)."""
        self.plectra, self.length = plectra, plectra.length
        self.stiffness, self.overlap = stiffness[:, None], overlap[:, None]
        self.rest = self.length - self.overlap
        """m, place of the string at rest, shape (cases, 1)."""
        self.first = plectra.first(self.rest)
        """m, its position on the plectrum at first contact, shape (cases, 1)."""
        self._pull = plectra.unit / self.stiffness
        """m^3, F s^2 / K at a load of one."""

    def subset(self, rows: Rows) -> "Equilibria":
        """Return some of the cases."""
        return Equilibria(self.plectra.subset(rows), self.stiffness[rows, 0], self.overlap[rows, 0])

    def sliding_load(self, s: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Return the load with which a sliding string is at positions s, and if there is one.

        The residual x - rest - shift rises at first with the load, by friction, and then
        falls, so its last change of sign is the one.

        Args:
            s: m, shape (cases, 1).

        Returns:
            Loads, the largest one where none is found; and whether one is; shape (cases,).
        """
        limit = self.plectra.load_limit(s)
        grid = LOADS * limit
        residual, rounding = self._residual(self._sliding(grid)(s), s, grid)
        positive = residual > rounding
        last = len(LOADS) - 1 - np.argmax(positive[:, ::-1], axis=1)[:, None]
        never, found = ~positive.any(axis=1, keepdims=True), ~positive[:, -1:]
        low = np.where(found, LOADS[last], 0.0) * limit
        high = np.where(found, LOADS[np.minimum(last + 1, len(LOADS) - 1)], 1.0) * limit
        load = high
        for _ in range(NEWTON_STEPS):
            at = self._sliding(load)(s)
            value, rounding = self._residual(at, s, load)
            slope = self._by_load(at, s, load, self.plectra.friction)[0]
            low, high = np.where(value > 0, load, low), np.where(value > 0, high, load)
            new = load - value / np.where(slope, slope, np.inf)
            new = np.where((new >= low) & (new <= high), new, (low + high) / 2)
            moved, load = np.abs(new - load), new
            if np.all((moved <= 1e-13 * load) | (np.abs(value) <= rounding / 10)):
                break
        load = np.where(found, np.where(never, 0.0, load), limit)
        return load[:, 0], found[:, 0]

    @cached_property
    def turn(self) -> Floats:
        """Largest loads under which the string slides towards the clamp, shape (cases, 1).

        As the plectrum turns, a string above its mid-line is moved outwards, over its surface
        towards the clamp, until it is bent so far that the string's force moves it towards the tip.
        Where friction prevents it, and on the mid-line, this is 0.
        """
        none = np.zeros_like(self.rest)
        # Gives the direction of the first friction.
        near = 1e-6 * self.plectra.load_limit(self.first) + none
        at = self.plectra.under(near, 0.0)(self.first)
        pull = self._pull * near / self.first**2
        drag = (at.sine + (self.rest - at.x) / pull) / at.cosine
        if not np.any(drag < -self.plectra.friction):
            return none
        # Before the load at which the string would slide towards the tip from its first position.
        last, slips = self.sliding_load(self.first)
        rows = np.flatnonzero((drag[:, 0] < -self.plectra.friction) & slips)
        if len(rows):
            none[rows] = self.subset(rows)._turn(near[rows], last[rows, None])
        return none

    def _turn(self, low: Floats, high: Floats) -> Floats:
        """Return the loads between two at which strings that slide to the clamp turn.

        Their position, at which the residual is zero, falls with the load where the residual rises
        with it. The root is found by the Illinois method.
        """
        mu = -self.plectra.friction

        def rate(load: Floats, instead: Floats) -> Floats:
            under = self.plectra.under(load, mu)
            s = self._slid(under, load, mu, self.first)
            # A load with which the string would be beyond the tip has no position, NaN.
            known = np.isfinite(s)
            s = np.where(known, s, self.length)
            found = self._by_load(under(s), s, load, mu)[0]
            return np.where(known & np.isfinite(found), found, instead)

        rising = rate(low, np.ones_like(low))
        never = rising <= 0
        falling = rate(high, -rising)
        turn, after = low, np.zeros(low.shape, bool)
        for step in range(40):  # 6 to 10 are usual
            before, turn = turn, high - falling * (high - low) / (falling - rising)
            value = rate(turn, -rising)
            twice = (value <= 0) == after if step else False
            after = value <= 0
            rising = np.where(after, np.where(twice, rising / 2, rising), value)
            falling = np.where(after, value, np.where(twice, falling / 2, falling))
            low, high = np.where(after, low, turn), np.where(after, turn, high)
            # The position is stationary there.
            if np.all(never | (np.abs(turn - before) <= 1e-6 * turn)):
                break
        return np.where(never, 0.0, turn)

    @cached_property
    def held(self) -> Floats:
        """m, position at which friction holds the string, shape (cases, 1)."""
        return self._sticking(self.turn)

    def _sticking(self, load: Floats) -> Floats:
        """Return the position [m] of a string that has not yet slid towards the tip."""
        if not self.turn.any():
            return np.repeat(self.first, load.shape[1], axis=1)
        back = self._slide(np.minimum(load, self.turn), -self.plectra.friction).position
        return np.where(self.turn > 0, np.minimum(back, self.first), self.first)

    def stick(self, load: Floats) -> Curve:
        """Return the equilibria of a string that friction holds, or that slides to the clamp."""
        s, mu = self._sticking(load), self.plectra.friction
        stuck, pull = self.plectra.stuck(load, s), self._pull * load / s**2
        drag = needed = before = gain = np.zeros_like(pull)
        at = stuck(drag)
        for step in range(STICKING_STEPS):
            # From K (x - rest) = F (sin a - T cos a), of which a and x depend on T a little: the
            # secant through two steps leaves a thousandth of the error. At rest there is no
            # friction, and no more than the coefficient allows but for rounding.
            back = np.divide(self.rest - at.x, pull, out=np.zeros_like(pull), where=pull > 0)
            before, needed = needed, (at.sine + back) / at.cosine
            miss = needed - drag
            if np.all(np.abs(miss) <= 1e-12) or step == STICKING_STEPS - 1:
                break
            if step == 1:
                moved = np.where(drag, drag, np.inf)
                gain = np.clip((needed - before) / moved, -0.5, 0.5)
            drag = np.clip(drag + miss / (1 - gain), -mu, mu)
            at = stuck(drag)
        return self._curve(at, load, s, drag)

    def _sliding(self, load: Floats) -> Callable[[Floats], Loaded]:
        """Return the plectra under loads of a string that slides to the tip."""
        return self.plectra.under(load, self.plectra.friction)

    def slide(self, load: Floats) -> Curve:
        """Return the equilibria of a string that slides towards the tip; NaN where not found."""
        return self._slide(load, self.plectra.friction)

    def _slide(self, load: Floats, mu: float) -> Curve:
        """Return the equilibria of a string that slides, with its force to the clamp over F."""
        under = self.plectra.under(load, mu)
        s = self._slid(under, load, mu, self._near(load, mu))
        # A string without a position has no curve there: s makes it NaN.
        at = under(np.where(np.isfinite(s), s, self.length))
        return self._curve(at, load, s, np.full_like(s, mu))

    def _near(self, load: Floats, mu: float) -> Floats:
        """Return where [m] strings that slide lie nearly: the search from there is short.

        On uniform plectra a search costs no more than this, and starts at the tip.
        """
        points = load.shape[1]
        if self.plectra.uniform or points <= 2 * FEW:
            return self.length
        some = np.linspace(0, points - 1, FEW).round().astype(int)
        few = load[:, some]
        found = self._slid(self.plectra.under(few, mu), few, mu, self.length)
        near = found @ between(points, tuple(some.tolist()))
        return np.where(np.isfinite(near), near, self.length)

    def _slid(
        self, under: Callable[[Floats], Loaded], load: Floats, mu: float, start: Floats
    ) -> Floats:
        """Return where [m] strings lie that slide; NaN where not found.

        Args:
            start: m, where the search starts, of a shape that fits the loads: it is safe from
                the tip, and near to where they lie.
        """
        pull, rest = self._pull * load, self.rest
        least, done = rest / 2, np.zeros(load.shape, bool)
        s = np.broadcast_to(start, load.shape)
        for _ in range(NEWTON_STEPS):
            # s^2 times the residual: of the elastica a cubic in s, convex on the way from the tip.
            at = under(s)
            beyond, square = at.x - rest, s * s
            value = beyond * square - pull * (at.sine - mu * at.cosine)
            slope = at.x_s * square + 2 * s * beyond
            if not isinstance(at.angle_s, float):
                slope = slope - pull * (at.cosine + mu * at.sine) * at.angle_s
            step = value / slope
            new = np.clip(s - step, least, self.length)
            small = np.abs(step) <= 1e-14 * (self.length + pull / square)
            if small.all():
                return new
            done = small | (np.abs(value) <= ROUNDING * (self.length * square + pull))
            if np.all(done | (new == s)):  # or at a bound, beyond which there is none
                break
            s = new
        return np.where(done, s, np.nan)

    def stick_slope(self, curve: Curve) -> Floats:
        """Return d(height)/d(load) at the end of a stretch that sticks, shape (cases,)."""
        ends = curve.height[:, -5:] @ AT_END
        return ends / np.maximum(curve.load[:, -1] - curve.load[:, -2], np.finfo(float).tiny)

    def slide_slope(self, curve: Curve) -> Floats:
        """Return d(height)/d(load) at the end of a stretch that slides, shape (cases,)."""
        s, load = curve.position[:, -1:], curve.load[:, -1:]
        at, mu = self._sliding(load)(s), self.plectra.friction
        pull = self._pull * load / s**2
        out, up = pull * (at.sine - mu * at.cosine), pull * (at.cosine + mu * at.sine)
        residual_l, height_l = self._by_load(at, s, load, mu)
        residual_s = at.x_s + 2 * out / s - up * at.angle_s
        height_s = -2 * up / s - out * at.angle_s - at.z_s
        return (height_l - height_s * residual_l / residual_s)[:, 0]

    def _residual(self, at: Loaded, s: Floats, load: Floats) -> tuple[Floats, Floats]:
        """Return x - rest - shift [m] of a sliding string, and what rounding makes of it [m]."""
        pull = self._pull * load / s**2
        shift = pull * (at.sine - self.plectra.friction * at.cosine)
        return at.x - self.rest - shift, ROUNDING * (self.length + pull)

    def _by_load(self, at: Loaded, s: Floats, load: Floats, mu: float) -> tuple[Floats, Floats]:
        """Return the derivatives by the load, at the same s, of that residual and the height."""
        x_l, z_l, angle_l = self.plectra.load_slopes(s, load, mu)
        pull = self._pull / s**2
        out, up = pull * (at.sine - mu * at.cosine), pull * (at.cosine + mu * at.sine)
        return x_l - out - load * up * angle_l, up - load * out * angle_l - z_l

    def _curve(self, at: Loaded | Stuck, load: Floats, s: Floats, drag: Floats) -> Curve:
        pull = self._pull * load / (s * s)
        lift = pull * (at.cosine + drag * at.sine)
        shift = pull * (at.sine - drag * at.cosine)
        force = pull * self.stiffness
        return Curve(load, lift - at.z, force, s, at.angle, lift, shift, drag)


@lru_cache(maxsize=8)
def between(points: int, some: tuple[int, ...]) -> Floats:
    """Return the matrix from values at some of evenly spaced points to those at all of them."""
    from scipy.interpolate import barycentric_interpolate

    return barycentric_interpolate(np.array(some), np.eye(len(some)), np.arange(points)).T
