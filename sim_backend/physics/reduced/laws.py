"""Force laws S(h) of many plucks for the reduced engine: piecewise cubics, smooth in pieces."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator

from sautereau.analysis.model.pluck.equilibria import Equilibria
from sautereau.analysis.model.pluck.loaded import UniformPlectra
from sautereau.analysis.model.pluck.paths import Status, solve_paths
from sautereau.analysis.model.pluck.pluck import Pluck
from sautereau.trajectory.motion import Floats

POINTS = 97
"""Points per piece where many plucks are solved together."""
MOST = 3
"""Most pieces of a law: the string sticks, slides and rolls."""


@dataclass(frozen=True)
class Laws:
    """Force laws of strings."""

    cells: Floats
    """Start of each cell [m], and the cubic of the force [N] from there; shape (cells, 5)."""
    places: Floats
    """Columns of a jack's row in a bench from `STRETCHES` on; shape (laws, 9)."""


def mute_law() -> Laws:
    """Return the law of a string without a plectrum."""
    return Laws(np.zeros((1, 5)), np.array([[1.0, 0, 1, 1, 1, 0, 1, 1, 1]]))


def laws_of(plucks: Sequence[Pluck]) -> Laws:
    """Return the laws of plucks, with the same cubics as their `force_on_jack`."""
    return joined([_law(pluck) for pluck in plucks])


def joined(laws: Sequence[Laws]) -> Laws:
    """Return laws concatenated."""
    starts = np.cumsum([0, *(len(law.cells) for law in laws)])
    places = [law.places.copy() for law in laws]
    for place, start in zip(places, starts, strict=False):
        place[:, 1:5] += start
    return Laws(np.concatenate([law.cells for law in laws]), np.concatenate(places))


def _law(pluck: Pluck) -> Laws:
    knots = pluck.height
    places = np.array([1, 3, 5, 7]) / 8
    steps = np.diff(knots)[:, None]
    values = pluck.force_on_jack(knots[:-1, None] + steps * places)
    cubics = np.linalg.solve(np.vander(places, 4, increasing=True), values.T).T
    cells = np.column_stack([knots[:-1], cubics / steps ** np.arange(4)])
    first = [*pluck.stretches, *[len(knots) - 1] * (MOST + 1 - len(pluck.stretches))]
    return Laws(cells, np.array([[len(pluck.stretches), *first, *knots[first]]]))


def elastica_laws(
    stiffness: Floats,
    overlap: Floats,
    bending: Floats,
    length: Floats,
    offset: Floats,
    friction: float,
) -> tuple[Laws, NDArray[np.bool_]]:
    """Solve many plucks of the elastica at once.

    Args:
        stiffness: N/m, of the strings; shape (laws,), as the next four.
        overlap: m.
        bending: N m^2, of the plectra.
        length: m, of the plectra.
        offset: m, of the strings' centres from the mid-lines.
        friction: Dimensionless, common to all.

    Returns:
        The laws, and which of them are valid; the others must not be used.
    """
    plectra = UniformPlectra(friction, length, bending, offset)
    with np.errstate(all="ignore"):
        paths = solve_paths(Equilibria(plectra, stiffness, overlap), POINTS)
        status = paths.status
        for curve in paths.curves:  # rounding apart, a pluck begins at 0
            start, end = curve.height[:, 0], curve.height[:, -1]
            start[np.abs(start) <= 1e-12 * np.abs(end)] = 0.0
        folded = status == Status.RELEASED_AT_FOLD
        cells = np.stack([_cells(c.height, c.lift, folded) for c in paths.curves], axis=1)
        cells[..., 1:] *= stiffness[:, None, None, None]
    ends = np.array([curve.height[:, [0, -1]] for curve in paths.curves])
    places = _places(ends)
    good = (status <= Status.RELEASED_AT_FOLD) & (places[:, 0] > 0)
    for part, (start, end) in zip(np.moveaxis(cells, 1, 0), np.moveaxis(ends, 2, 1), strict=True):
        good &= np.isfinite(part).all(axis=(1, 2)) | ~_lasts(start, end)
    return Laws(cells.reshape(-1, 5), places), good


def _cells(height: Floats, force: Floats, folded: NDArray[np.bool_]) -> Floats:
    """Return starts [m] of cells and cubics of the force over K; shape (laws, cells, 5)."""
    share = np.arange(POINTS)
    step = np.diff(height, axis=1)
    # Both are smooth functions of the load, in which the points are equidistant.
    with np.errstate(all="ignore"):
        by_share = [CubicSpline(share, np.nan_to_num(a), axis=1)(share, 1) for a in (force, height)]
        slope = by_share[0] / by_share[1]
    for row in np.flatnonzero(folded & (step > 0).all(axis=1)):
        # At a fold the slope of the force is unbounded, and a smooth spline would oscillate.
        slope[row] = PchipInterpolator(height[row], force[row])(height[row], 1)
    rise = np.diff(force, axis=1) / step
    left, right = slope[:, :-1], slope[:, 1:]
    second, third = (3 * rise - 2 * left - right) / step, (left + right - 2 * rise) / step**2
    return np.stack([height[:, :-1], force[:, :-1], left, second, third], axis=-1)


def _lasts(start: Floats, end: Floats) -> NDArray[np.bool_]:
    """Return whether pieces have a length: a string may never stick, or never slide."""
    return end - start > 1e-12 * np.abs(end)


def _places(ends: Floats) -> Floats:
    """Return the places of laws whose pieces extend between given heights.

    Args:
        ends: m; shape (pieces, laws, 2).
    """
    n, cells = ends.shape[1], POINTS - 1
    places = np.zeros((n, 3 + 2 * MOST))
    for j, (start, end) in enumerate(np.moveaxis(ends, 2, 1)):
        rows = np.flatnonzero(_lasts(start, end))
        at = places[rows, 0].astype(int)
        places[rows, 0] += 1
        for k, height in ((0, start), (1, end)):
            places[rows, 1 + at + k] = (rows * len(ends) + j + k) * cells
            places[rows, 2 + MOST + at + k] = height[rows]
    return places
