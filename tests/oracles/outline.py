"""Shapes of a plectrum for the independent solution of the pluck."""

from __future__ import annotations

import itertools
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass

Curve = Callable[[float], float]


@dataclass(frozen=True)
class Outline:
    """Upper and lower edge of an unloaded plectrum over the distance x from the clamp.

    The mid-line is (top + bottom) / 2, the thickness top - bottom, measured vertically.
    """

    length: float
    """In m."""
    top: Curve
    """Height of the upper edge at x in m, in m; likewise `bottom`."""
    bottom: Curve
    top_slope: Curve
    """Slope of the upper edge at x in m, dimensionless; likewise `bottom_slope`."""
    bottom_slope: Curve
    breaks: tuple[float, ...] = ()
    """Places in m at which an edge is not smooth, inside (0, length)."""
    patch: float = 0.0
    """Length in m over which height and slope of the top under the string are averaged."""

    def under_string(self, s: float) -> tuple[float, float]:
        """Return height (m) and slope (dimensionless) of the top where the string lies at s (m).

        At a break these are those of the side towards the clamp.
        """
        s -= 1e-12 * self.length
        if not self.patch:
            return self.top(s), self.top_slope(s)
        start, end = max(s - self.patch / 2, 0.0), min(s + self.patch / 2, self.length)
        inner = [b for b in self.breaks if start < b < end]
        edges = [start, *inner, end]
        # Simpson's rule: exact for straight pieces and parabolas
        area = sum(
            (hi - lo) / 6 * (self.top(lo) + 4 * self.top((lo + hi) / 2) + self.top(hi))
            for lo, hi in itertools.pairwise(edges)
        )
        return area / (end - start), (self.top(end) - self.top(start)) / (end - start)


def uniform(length: float, thickness: float) -> Outline:
    """Return a straight bar; length and thickness in m."""
    return stepped(length, [], [thickness])


def stepped(length: float, steps: Sequence[float], thicknesses: Sequence[float]) -> Outline:
    """Return a bar with a straight mid-line and a piecewise constant thickness, all in m."""
    halves = [t / 2 for t in thicknesses]

    def top(x: float) -> float:
        return halves[bisect_left(steps, x)]

    return Outline(length, top, lambda x: -top(x), _flat, _flat, tuple(steps))


def polygon(x: Sequence[float], top: Sequence[float], bottom: Sequence[float]) -> Outline:
    """Return an outline that is straight between points; all in m, x from 0 to the tip."""
    x, top, bottom = list(map(float, x)), list(map(float, top)), list(map(float, bottom))

    def straight(z: list[float]) -> tuple[Curve, Curve]:
        slopes = [(z[i + 1] - z[i]) / (x[i + 1] - x[i]) for i in range(len(x) - 1)]

        def piece(at: float) -> int:
            return min(max(bisect_left(x, at) - 1, 0), len(slopes) - 1)

        def height(at: float) -> float:
            i = piece(at)
            return z[i] + slopes[i] * (at - x[i])

        return height, lambda at: slopes[piece(at)]

    top_height, top_slope = straight(top)
    bottom_height, bottom_slope = straight(bottom)
    return Outline(x[-1], top_height, bottom_height, top_slope, bottom_slope, tuple(x[1:-1]))


def _flat(_: float) -> float:
    return 0.0
