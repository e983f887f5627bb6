"""The solver of the pluck: from first contact to release, for many cases at once."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.pluck.equilibria import Curve, Equilibria
from sautereau.analysis.model.pluck.loaded import Rows

NEAR = 33  # Number of points of such a search


class Status(IntEnum):
    """How a pluck ended; the first two have results, the others NaN in their place."""

    RELEASED = 0
    """The string was released at the tip."""
    RELEASED_AT_FOLD = 1
    """The curve of equilibria folds before the tip: the string was released there."""
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
    """string: its stiffness or its lift not within the model's range, or frequency not above 0."""
    PRESS_OUT_OF_RANGE = 8
    """press.jack_speed or jack.string_clearance not finite and above 0."""
    KEY_OUT_OF_RANGE = 9
    """key or jack: an arm or an inertia not above 0, or a number not finite."""
    NOT_CONVERGED = 10
    """string or plectrum: no equilibrium was found, at values far out of the usual range."""


class Kind(NamedTuple):
    """A kind of stretch: the string sticks or slides."""

    at: Callable[[Equilibria, Floats], Curve]
    """Equilibria at loads of shape (cases, points)."""
    slope_at_end: Callable[[Equilibria, Curve], Floats]
    """d(height)/d(load) at the end of a curve, shape (cases,)."""


STICK = Kind(Equilibria.stick, Equilibria.stick_slope)
SLIDE = Kind(Equilibria.slide, Equilibria.slide_slope)


@dataclass(frozen=True)
class Paths:
    """Plucks as stretches of equilibria, one after the other."""

    kinds: tuple[Kind, ...]
    """Kinds of the curves."""
    curves: tuple[Curve, ...]
    """With friction a stretch that sticks, then one that slides; shape (cases, points). A
    stretch that a case does not have is of constant load."""
    status: NDArray[np.int_]
    """A `Status` each, shape (cases,)."""


def solve_paths(equilibria: Equilibria, points: int) -> Paths:
    """Follow the strings along their plectra from first contact to release.

    Args:
        points: Points of a stretch; a dip of the height between two of them is not seen.
    """
    slip, slips = np.zeros(len(equilibria.rest)), np.ones(len(equilibria.rest), bool)
    kinds = (STICK, SLIDE) if equilibria.plectra.friction > 0 else (SLIDE,)
    if STICK in kinds:
        slip, slips = equilibria.sliding_load(equilibria.held)
    end, released = equilibria.sliding_load(equilibria.length)
    status = np.where(released & slips, Status.RELEASED, Status.STILL_HELD)
    # A string that never slips has a slide of no length, at no load.
    start, end = np.where(slips, [slip, np.maximum(end, slip)], 0.0)
    loads = {STICK: (np.zeros_like(slip), slip), SLIDE: (start, end)}
    curves = [kind.at(equilibria, ramp(loads[kind][0], loads[kind][1], points)) for kind in kinds]
    parts = []
    for kind, curve in zip(kinds, curves, strict=True):
        falling = np.diff(curve.height) <= 0
        falling[:, -1] |= kind.slope_at_end(equilibria, curve) <= 0
        parts.append(falling & lasts(curve.load)[:, None])
    falling = np.concatenate(parts, axis=1)
    height = np.concatenate([curves[0].height, *(c.height[:, 1:] for c in curves[1:])], axis=1)
    folded = np.flatnonzero(falling.any(axis=1))
    if len(folded):
        top = np.argmax(falling[folded], axis=1)
        highest = np.maximum(height[folded, top], height[folded, top + 1])
        beyond = np.where(np.arange(height.shape[1]) > top[:, None] + 1, height[folded], -np.inf)
        jumps = beyond.max(axis=1) > highest
        status[folded] = np.where(jumps, Status.JUMPS, Status.RELEASED_AT_FOLD)
        for number in range(len(kinds)):
            here = top // (points - 1) == number
            _end_at_folds(
                equilibria, kinds[number:], curves[number:], folded[here], top[here] % (points - 1)
            )
    status[~np.isfinite(height).all(axis=1)] = Status.NOT_CONVERGED
    return Paths(kinds, tuple(curves), status)


def _end_at_folds(
    equilibria: Equilibria, kinds: tuple[Kind, ...], curves: list[Curve], rows: Rows, top: Rows
) -> None:
    """End the first of some curves at folds next to its points `top`; the others go."""
    if not len(rows):
        return
    some, load = equilibria.subset(rows), curves[0].load[rows]
    points, peak = load.shape[1], _fold(some, kinds[0], load, top)
    ends = [ramp(load[:, 0], peak, points), *[ramp(peak, peak, points)] * (len(kinds) - 1)]
    for curve, end in zip(curves, ends, strict=True):
        ended = vars(kinds[0].at(some, end))
        for name, values in vars(curve).items():
            values[rows] = ended[name]


def _fold(some: Equilibria, kind: Kind, load: Floats, top: Rows) -> Floats:
    """Return the loads of the folds that are next to the points `top`, shape (cases,)."""
    rows, last = np.arange(len(load)), load.shape[1] - 1
    low, high = load[rows, np.maximum(top - 1, 0)], load[rows, np.minimum(top + 1, last)]
    peak = low
    for _ in range(9):  # Each between the neighbours of the last best point
        near = ramp(low, high, NEAR)
        best = np.argmax(kind.at(some, near).height, axis=1)
        peak = near[rows, best]
        low = near[rows, np.maximum(best - 1, 0)]
        high = near[rows, np.minimum(best + 1, NEAR - 1)]
    return peak


def ramp(low: Floats, high: Floats, points: int) -> Floats:
    """Return evenly spaced values from low to high, shape (cases, points)."""
    fraction = np.linspace(0.0, 1.0, points)
    return low[:, None] * (1 - fraction) + high[:, None] * fraction


def lasts(load: Floats) -> NDArray[np.bool_]:
    """Return which stretches of loads (cases, points) are not of constant load."""
    return load[:, -1] > load[:, 0] * (1 + 1e-12)
