"""Force laws S(h) of plucks for the exact engine: piecewise cubics, smooth in pieces."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator

from sautereau.analysis.model.choirs import choir_pluck
from sautereau.analysis.model.pluck.equilibria import Equilibria
from sautereau.analysis.model.pluck.loaded import UniformPlectra
from sautereau.analysis.model.pluck.paths import Status, solve_paths
from sautereau.rig.instrument import Choir, Plectrum, String
from sautereau.sim_backend.physics.exact.structures import JACK, PIECES
from sautereau.trajectory.motion import Floats

POINTS = 97
"""Points per piece where many plucks are solved together."""


@dataclass(frozen=True)
class Laws:
    """Force laws of strings."""

    cells: Floats
    """Start of each cell [m], and the cubic of the force [N] from there; shape (cells, 5)."""
    jacks: NDArray[Any]
    """`JACK`s of which `pieces`, `first` and `border` are set; shape (laws,)."""


def mute_law() -> Laws:
    """Return the law of a string without a plectrum."""
    return Laws(np.zeros((1, 5)), np.zeros(1, JACK))


def choir_law(choir: Choir, level: str) -> Laws:
    """Return the law of a choir's pluck, with the same cubics as its `force_on_jack`.

    Raises:
        ModelError: The choir has no pluck.
    """
    return _law(choir.plectrum, choir.string, level)


def joined(laws: Sequence[Laws]) -> Laws:
    """Return laws concatenated."""
    if len(laws) == 1:
        return laws[0]
    starts = np.cumsum([0, *(len(law.cells) for law in laws)])
    jacks = [law.jacks.copy() for law in laws]
    for jack, start in zip(jacks, starts, strict=False):
        jack["first"] += start
    return Laws(np.concatenate([law.cells for law in laws]), np.concatenate(jacks))


@lru_cache(maxsize=256)
def _law(plectrum: Plectrum, string: String, level: str) -> Laws:
    pluck = choir_pluck(Choir.model_construct(plectrum=plectrum, string=string), level)
    knots, jack = pluck.height, np.zeros(1, JACK)
    places = np.array([1, 3, 5, 7]) / 8
    steps = np.diff(knots)[:, None]
    values = pluck.force_on_jack(knots[:-1, None] + steps * places)
    cubics = np.linalg.solve(np.vander(places, 4, increasing=True), values.T).T
    cells = np.column_stack([knots[:-1], cubics / steps ** np.arange(4)])
    first = [*pluck.stretches, *[len(knots) - 1] * (PIECES + 1 - len(pluck.stretches))]
    jack["pieces"], jack["first"], jack["border"] = len(pluck.stretches), first, knots[first]
    return Laws(cells, jack)


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
    jacks = _pieces(ends)
    good = (status <= Status.RELEASED_AT_FOLD) & (jacks["pieces"] > 0)
    for part, (start, end) in zip(np.moveaxis(cells, 1, 0), np.moveaxis(ends, 2, 1), strict=True):
        good &= np.isfinite(part).all(axis=(1, 2)) | ~_lasts(start, end)
    return Laws(cells.reshape(-1, 5), jacks), good


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


def _pieces(ends: Floats) -> NDArray[Any]:
    """Return the `JACK`s of laws whose pieces extend between given heights.

    Args:
        ends: m; shape (pieces, laws, 2).
    """
    n, cells = ends.shape[1], POINTS - 1
    jacks = np.zeros(n, JACK)
    for j, (start, end) in enumerate(np.moveaxis(ends, 2, 1)):
        rows = np.flatnonzero(_lasts(start, end))
        at = jacks["pieces"][rows]
        jacks["pieces"][rows] += 1
        for k, height in ((0, start), (1, end)):
            jacks["first"][rows, at + k] = (rows * len(ends) + j + k) * cells
            jacks["border"][rows, at + k] = height[rows]
    return jacks
