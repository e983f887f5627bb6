"""The pluck of the elastica for many cases at once, in numbers without a dimension.

In lengths of the plectrum and with k = EI / (K L^3), o = overlap / L and the load
q = F s^2 / EI, a sliding string is in equilibrium along the plectrum where

    s^3 x(q) - (1 - o) s^2 - k q along(q) = 0,

and the height of the jack is k q up(q) / s^2 - s z(q). Each q has one such s, the largest
root, and each s one q: so q leads from first contact to the release past any fold.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.pluck.table import Shape, Table

GRID = 64
"""Loads among which a root is enclosed."""
POINTS = 33
"""Points of a stretch that sticks or slides; a dip of the height between two is not seen."""
NARROWINGS = 9
"""Times that a fold is looked for again, each time between two neighbours of it."""
NEWTON_STEPS = 60


class Status(IntEnum):
    """How a case ended; the scalars hold a number in the first two, NaN in the others."""

    RELEASED = 0
    """The string was let go at the tip."""
    GIVES_WAY = 1
    """The plectrum gave way under the string before: it was let go there."""
    STILL_HELD = 2
    """plectrum.overlap: the plectrum is bent by 90 degrees and the string still on it."""
    JUMPS = 3
    """plectrum.overlap: the string jumps along the plectrum and is held again."""
    PRESS_TOO_SHORT = 4
    """press.jack_rise: the press ends before the string is released."""
    OVERLAP_OUT_OF_RANGE = 5
    """plectrum.overlap: not between 0 and, nearly, plectrum.length."""
    PLECTRUM_OUT_OF_RANGE = 6
    """plectrum: youngs_modulus, width, thickness or length not finite and above 0."""
    STRING_OUT_OF_RANGE = 7
    """string: its stiffness not within the model's range, or frequency not above 0."""
    PRESS_OUT_OF_RANGE = 8
    """press.jack_speed or jack.string_clearance not finite and above 0."""
    KEY_OUT_OF_RANGE = 9
    """key or jack: an arm or an inertia not above 0, or a number not finite."""


@dataclass(frozen=True)
class Branch:
    """Equilibria of many cases; arrays of shape (cases, points), lengths over L."""

    q: Floats
    s: Floats
    height: Floats
    lift: Floats
    up: Floats
    """1, vertical force over F."""
    sine: Floats
    """1, of the angle by which the plectrum is bent down."""
    cosine: Floats


@dataclass(frozen=True)
class Cases:
    """Many plucks; k and o of shape (cases,)."""

    table: Table
    k: Floats
    o: Floats

    def solve(self) -> tuple[Branch, Branch | None, NDArray[np.int_]]:
        """Return the branch that ends at the release, its stick before it, and the statuses."""
        sticks = self.table.friction > 0
        slip, slips = np.zeros_like(self.o), np.ones(len(self.o), bool)
        if sticks:
            slip, slips = self._sliding_load(self.k / (1 - self.o) ** 3, slip)
        end, released = self._sliding_load(self.k, self.o)
        status = np.where(released & slips, Status.RELEASED, Status.STILL_HELD)
        stick = self.stick(ramp(np.zeros_like(slip), slip)) if sticks else None
        slip, end = np.where(slips, [slip, np.maximum(end, slip)], 0.0)
        slide = self.slide(ramp(slip, end))
        height = slide.height if stick is None else np.hstack([stick.height, slide.height[:, 1:]])
        falling = np.diff(height) <= 0
        # A stretch of no length, such as the slide of a string that never slips, does not fall.
        falling[:, -(POINTS - 1) :] &= (end > slip * (1 + 1e-12))[:, None]
        if stick is not None:
            falling[:, : POINTS - 1] &= (stick.q[:, -1] > 0)[:, None]
        turning = self._slope(slide)[:, -1] <= 0
        falling[:, -1] |= turning & (end > slip)
        folded = np.flatnonzero(falling.any(axis=1))
        if len(folded):
            stick, slide, jumps = self._end_at_fold(
                folded, np.argmax(falling[folded], axis=1), height[folded], stick, slide
            )
            status[folded] = np.where(jumps, Status.JUMPS, Status.GIVES_WAY)
        return slide, stick, status

    def stick(self, q: Floats) -> Branch:
        """Return the equilibria of a string that friction holds where it was met."""
        at, mu = self.table.shape(q), self.table.friction
        sine, cosine = _angle(at, mu)
        s = np.repeat((1 - self.o)[:, None], q.shape[1], axis=1)
        pull = self.k[:, None] * q / s**2
        back = s * (1 - at.x)
        drag = np.divide(back, pull, out=np.zeros_like(pull), where=pull > 0)
        up = cosine + (sine + drag) / cosine * sine
        return Branch(q, s, pull * up - s * at.z, pull * up, up, sine, cosine)

    def slide(self, q: Floats) -> Branch:
        """Return the equilibria of a sliding string at loads q, shape (cases, points)."""
        at = self.table.shape(q)
        k, rest = self.k[:, None], (1 - self.o)[:, None]
        pulled = k * q * at.along
        s = np.ones_like(q)
        for _ in range(NEWTON_STEPS):
            value = (at.x * s - rest) * s * s - pulled
            step = value / (s * (3 * at.x * s - 2 * rest))
            s = s - step
            if np.all(np.abs(step) <= 1e-14 * (1 + np.abs(pulled))):
                break
        lift = k * q * at.up / s**2
        return Branch(q, s, lift - s * at.z, lift, at.up, *_angle(at, self.table.friction))

    def _slope(self, slide: Branch) -> Floats:
        """Return d(height)/dq along a slide."""
        at, by_q = self.table.shape_and_slope(slide.q)
        k, rest, q, s = self.k[:, None], (1 - self.o)[:, None], slide.q, slide.s
        s_q = k * (at.along + q * by_q.along) - s**3 * by_q.x
        s_q = s_q / (s * (3 * at.x * s - 2 * rest))
        direct = k * (at.up + q * by_q.up) / s**2 - s * by_q.z
        return direct - s_q * (2 * k * q * at.up / s**3 + at.z)

    def _sliding_load(self, k: Floats, o: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Return q at which a string slides over the place of overlap 0, and whether it does.

        x(q) - k q along(q) - (1 - o) rises at first, by friction, and then falls.
        """
        table = self.table
        grid = np.concatenate([[0.0], np.geomspace(1e-14, 1.0, GRID)]) * table.q_max
        at = table.shape(grid)
        residual = (at.x - 1) + o[:, None] - k[:, None] * (grid * at.along)
        positive = residual > 1e-15 * (1 + k[:, None] * grid)
        last = GRID - np.argmax(positive[:, ::-1], axis=1)
        never = ~positive.any(axis=1)
        found = ~positive[:, -1]
        low = grid[np.minimum(last, GRID - 1)]
        high = grid[np.minimum(last + 1, GRID)]
        q = high
        for _ in range(NEWTON_STEPS):
            at, by_q = table.shape_and_slope(q)
            value = (at.x - 1) + o - k * q * at.along
            slope = by_q.x - k * (at.along + q * by_q.along)
            low, high = np.where(value > 0, q, low), np.where(value > 0, high, q)
            there = q - value / np.where(slope, slope, np.inf)
            there = np.where((there >= low) & (there <= high), there, (low + high) / 2)
            moved = np.abs(there - q)
            q = there
            if np.all((moved <= 1e-13 * q) | (np.abs(value) <= 1e-16 * (1 + k * q))):
                break
        q = np.where(found, q, table.q_max)
        return np.where(never, 0.0, q), found

    def _end_at_fold(
        self,
        folded: NDArray[np.intp],
        top: NDArray[np.intp],
        height: Floats,
        stick: Branch | None,
        slide: Branch,
    ) -> tuple[Branch | None, Branch, NDArray[np.bool_]]:
        """Return the branches with the folded cases ended at their folds, and which jump.

        Args:
            folded: Cases with a fold.
            top: Their last points before the height falls, over stick and slide.
            height: Their heights over stick and slide.
            stick: Of all cases, changed in place.
            slide: Of all cases, changed in place.
        """
        rows = np.arange(len(folded))
        after = np.where(np.arange(height.shape[1]) > top[:, None], height, -np.inf)
        # Where the height has turned only at the last point its top lies before that.
        jumps = (after.max(axis=1) > height[rows, top]) & (top < height.shape[1] - 2)
        slides = np.full(len(folded), True)
        if stick is not None:
            slides = top >= POINTS - 1
            part, at = folded[~slides], top[~slides]
            chosen = Cases(self.table, self.k[part], self.o[part])
            ended = chosen._until_fold(chosen.stick, stick.q[part], at)
            _put(stick, part, ended)
            _put(slide, part, chosen.stick(ramp(ended.q[:, -1], ended.q[:, -1])))
            top = top - (POINTS - 1)
        part = folded[slides]
        chosen = Cases(self.table, self.k[part], self.o[part])
        _put(slide, part, chosen._until_fold(chosen.slide, slide.q[part], top[slides]))
        return stick, slide, jumps

    def _until_fold(
        self, at: Callable[[Floats], Branch], q: Floats, top: NDArray[np.intp]
    ) -> Branch:
        """Return a stretch up to the fold that is next to its points `top`."""
        rows = np.arange(len(q))
        low, high = q[rows, np.maximum(top - 1, 0)], q[rows, np.minimum(top + 1, POINTS - 1)]
        peak = low
        for _ in range(NARROWINGS):
            near = ramp(low, high)
            best = np.argmax(at(near).height, axis=1)
            peak = near[rows, best]
            low = near[rows, np.maximum(best - 1, 0)]
            high = near[rows, np.minimum(best + 1, POINTS - 1)]
        return at(ramp(q[:, 0], peak))


def ramp(low: Floats, high: Floats) -> Floats:
    """Return points from low to high, shape (cases, POINTS)."""
    share = np.linspace(0.0, 1.0, POINTS)
    return low[:, None] * (1 - share) + high[:, None] * share


def _angle(at: Shape, mu: float) -> tuple[Floats, Floats]:
    """Return sine and cosine of the angle by which the plectrum is bent down."""
    scale = 1 / (1 + mu**2)
    return (at.along + mu * at.up) * scale, (at.up - mu * at.along) * scale


def _put(branch: Branch, rows: NDArray[np.intp], part: Branch) -> None:
    for field, values in vars(branch).items():
        values[rows] = vars(part)[field]
