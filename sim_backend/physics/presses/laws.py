"""Force laws S(h) of plucks: piecewise cubics, smooth in pieces; many are solved together."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.choirs import choirs, pluck_of
from sautereau.analysis.model.pluck.equilibria import Equilibria
from sautereau.analysis.model.pluck.loaded import UniformPlectra
from sautereau.analysis.model.pluck.paths import Status, solve_paths
from sautereau.analysis.model.pluck.pluck import OVERLAP_MAX, STIFFNESS_RANGE
from sautereau.rig.instrument import Choir, Plectrum, String
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.exact.structures import SLIDING, STUCK
from sautereau.sim_backend.physics.presses.parameters import Numbers
from sautereau.trajectory.motion import Floats

POINTS = 65
"""Points per piece where many plucks are solved together."""
CHUNK = 192
"""Plucks that are solved together; limited by the processor's cache."""
PLECTRUM = tuple(
    f"plectrum.{n}"
    for n in ("friction", "overlap", "length", "thickness", "width", "youngs_modulus")
)
STRING = tuple(f"string.{n}" for n in ("tension", "length", "plucking_point", "diameter"))
DERIVED = ("plectrum.bending_stiffness", "string.static_stiffness")
"""Values of a pluck by dotted key; with the elastica the derived ones may be given too."""
_EDGE = np.array([[-25, 48, -36, 16, -3], [-3, -10, 18, -6, 1]]).T / 12
"""Differences of order 4 at the first two points."""


@dataclass(frozen=True)
class Laws:
    """Force laws of strings."""

    cells: Floats
    """Start of each cell [m], and the cubic of the force [N] from there; shape (cells, 5)."""
    first: NDArray[np.int64]
    """First cells of each law where the string sticks and where it slides, and the end of its
    last; shape (laws, 3)."""
    border: Floats
    """Heights there [m], equal where the string never sticks or never slides; shape (laws, 3)."""


def set_laws(
    numbers: Numbers, jacks: NDArray[Any], played: NDArray[np.bool_]
) -> tuple[Floats, NDArray[np.bool_]]:
    """Set the force laws of all strings; return their cells, and the presses that have a pluck.

    Args:
        jacks: Of the presses, shape (presses, choirs).
        played: Presses with values within their limits; shape (presses,).

    Raises:
        SceneError: A plectrum and string that do not vary have no pluck.
    """
    plucks, level = np.ones(len(jacks), bool), numbers.scene.plectrum
    cells, found = 0, [np.zeros((0, 5))]
    for k, (at, choir) in enumerate(zip(numbers.prefixes, choirs(numbers.rig), strict=True)):
        if level == "none" or not played.any():
            continue
        names = (*PLECTRUM, *STRING, *DERIVED)
        given = {n: numbers.given[f"{at}{n}"] for n in names if f"{at}{n}" in numbers.given}
        if given:
            different, which = _different(given, played)
            solve = _elastica if level == "elastica" else _one_by_one
            laws, good = solve(choir, level, different)
            plucks &= good[which]
        else:
            try:
                plectrum, string = choir.plectrum, choir.string
                laws, which = law_of(plectrum, string, level), 0  # pyright: ignore[reportArgumentType]
            except ModelError as error:
                raise SceneError(f"rig {numbers.rig.name}: {at}{error}") from error
        jack = jacks[:, k]
        jack["first"], border = laws.first[which] + cells, laws.border[which]
        jack["range"][:, STUCK] += border[..., :2]
        jack["range"][:, SLIDING] += border[..., 1:]
        cells += len(laws.cells)
        found.append(laws.cells)
    return np.concatenate(found), plucks


def _different(
    values: Mapping[str, Floats], played: NDArray[np.bool_]
) -> tuple[dict[str, Floats], NDArray[np.int64]]:
    """Return the different plucks among the valid presses, and the pluck of each press.

    They are in order of their first value. An invalid press has the first pluck.
    """
    table = np.stack([np.broadcast_to(value, played.shape) for value in values.values()])
    different, inverse = np.unique(table[:, played], axis=1, return_inverse=True)
    which = np.zeros(len(played), np.int64)
    which[played] = inverse
    return dict(zip(values, different, strict=True)), which


def _elastica(
    choir: Choir, level: str, values: Mapping[str, Floats]
) -> tuple[Laws, NDArray[np.bool_]]:
    """Return laws of the elastica, and which of them are valid."""
    varied = choir.replaced({n: value for n, value in values.items() if n not in DERIVED})
    plectrum, string = varied.plectrum, varied.string
    bending = values.get(DERIVED[0], plectrum.bending_stiffness)
    stiffness = values.get(DERIVED[1], string.static_stiffness)
    offset = (plectrum.thickness + string.diameter) / 2 * (plectrum.contact == "surface")
    parts = (stiffness, plectrum.overlap, bending, plectrum.length, offset, plectrum.friction)
    count = len(next(iter(values.values())))
    stiffness, overlap, bending, length, offset, friction = np.stack(
        [np.broadcast_to(part, count) for part in parts]
    )
    low, high = STIFFNESS_RANGE
    good = (stiffness >= low) & (stiffness <= high) & (overlap <= OVERLAP_MAX * length)
    stiffness, overlap = np.where(good, (stiffness, overlap), ([[1.0], [0.1]] * length))
    laws, ends = [], np.flatnonzero(np.diff(friction)) + 1
    for start, end in zip([0, *ends], [*ends, count], strict=True):
        for first in range(start, end, CHUNK):
            part = slice(first, min(first + CHUNK, end))
            some = [a[part] for a in (stiffness, overlap, bending, length, offset)]
            solved, sure = elastica_laws(*some, friction=float(friction[start]))
            good[part] &= sure
            laws.append(solved)
    return _joined(laws), good


def _one_by_one(
    choir: Choir, level: str, values: Mapping[str, Floats]
) -> tuple[Laws, NDArray[np.bool_]]:
    """Return laws of any level, and which of them are valid."""
    rows = np.column_stack(list(values.values())).tolist()
    good, laws = np.ones(len(rows), bool), []
    for i, row in enumerate(rows):
        try:
            varied = choir.replaced(dict(zip(values, row, strict=True)))
            plectrum, string = varied.plectrum, varied.string
            laws.append(law_of(plectrum, string, level))  # pyright: ignore[reportArgumentType]
        except ModelError:
            good[i] = False
            laws.append(Laws(np.zeros((1, 5)), np.zeros((1, 3), np.int64), np.zeros((1, 3))))
    return _joined(laws), good


def _joined(parts: list[Laws]) -> Laws:
    """Return the laws of all parts."""
    starts = np.cumsum([0, *(len(part.cells) for part in parts[:-1])])
    return Laws(
        np.concatenate([part.cells for part in parts]),
        np.concatenate([part.first + start for part, start in zip(parts, starts, strict=True)]),
        np.concatenate([part.border for part in parts]),
    )


@lru_cache(maxsize=256)
def law_of(plectrum: Plectrum, string: String, level: str) -> Laws:
    """Return the law of one pluck, with the same cubics as its `force_on_jack`.

    Raises:
        ModelError: The plectrum and string have no pluck.
    """
    pluck = pluck_of(plectrum, string, level)  # pyright: ignore[reportArgumentType]
    knots = pluck.height
    places = np.array([1, 3, 5, 7]) / 8
    steps = np.diff(knots)[:, None]
    values = pluck.force_on_jack(knots[:-1, None] + steps * places)
    cubics = np.linalg.solve(np.vander(places, 4, increasing=True), values.T).T
    cells = np.column_stack([knots[:-1], cubics / steps ** np.arange(4)])
    first = np.array([[0, pluck.stretches[-1], len(cells)]])
    return Laws(cells, first, knots[first])


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
    start = np.array([curve.height[:, 0] for curve in paths.curves])
    end = np.array([curve.height[:, -1] for curve in paths.curves])
    lasts = end - start > 1e-12 * np.abs(end)
    good = (status <= Status.RELEASED_AT_FOLD) & lasts.any(axis=0)
    for j, some in enumerate(lasts):
        good &= np.isfinite(cells[:, j]).all(axis=(1, 2)) | ~some
    sticks, slides = lasts[0] & (len(lasts) > 1), lasts[-1]
    first = np.array([0, len(lasts) - 1, 0]) + len(lasts) * np.arange(len(good))[:, None]
    first[:, 2] = first[:, 1] + slides
    border = np.where(
        [sticks, slides, slides], [start[0], start[-1], end[-1]], [start[-1], end[0], end[0]]
    )
    return Laws(cells.reshape(-1, 5), first * (POINTS - 1), border.T), good


def _cells(height: Floats, force: Floats, folded: NDArray[np.bool_]) -> Floats:
    """Return starts [m] of cells and cubics of the force over K; shape (laws, cells, 5)."""
    step = np.diff(height, axis=1)
    # Both are smooth functions of the load, in which the points are equidistant.
    with np.errstate(all="ignore"):
        slope = _slopes(force) / _slopes(height)
    for row in np.flatnonzero(folded & (step > 0).all(axis=1)):
        # At a fold the slope of the force is unbounded, and a smooth spline would oscillate.
        slope[row] = PchipInterpolator(height[row], force[row])(height[row], 1)
    rise = np.diff(force, axis=1) / step
    left, right = slope[:, :-1], slope[:, 1:]
    second, third = (3 * rise - 2 * left - right) / step, (left + right - 2 * rise) / step**2
    return np.stack([height[:, :-1], force[:, :-1], left, second, third], axis=-1)


def _slopes(values: Floats) -> Floats:
    """Return the derivatives by the number of the point, of order 4; shape (laws, POINTS)."""
    near, far = values[:, 3:-1] - values[:, 1:-3], values[:, 4:] - values[:, :-4]
    start, end = values[:, :5] @ _EDGE, values[:, :-6:-1] @ -_EDGE
    return np.concatenate([start, (8 * near - far) / 12, end[:, ::-1]], axis=1)
