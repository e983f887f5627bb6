"""A carved plectrum's outline: the closed contour of a tracing, or of a photograph.

A tracing is a CSV file with the columns x and z, in units of length, the clamp at x = 0 and
the tip at the largest x. A photograph's contour is one with the columns x and y in pixels, y
counted downwards as in image programs; the rig file gives their size and the clamp:
``outline = { file = "photo.csv", scale = "0.01 mm", clamp = [212, 640] }``. Its tip may point
either way. Everything behind the clamp is cut off.

`sautereau outline` writes a tracing with a third column, member: 0 is the outline, and each number
from 1 is one of the ensemble between which the photograph cannot decide.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.rig.csv_files import read_columns, read_rows
from sautereau.rig.errors import RigError
from sautereau.rig.units import parse_quantity, shown

Floats = NDArray[np.float64]

LEAST_POINTS = 6  # Smallest number of points of a contour
ENDS = 0.02
"""Dimensionless, fraction of the length near either end where a contour may go back and forth,
as blunt ends do."""


def read_outline(table: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return the outline of a contour's file, as a rig file would hold it.

    Args:
        table: ``file``, and for a photograph ``scale`` and ``clamp``.

    Raises:
        RigError: The file cannot be read, or its contour is not that of a plectrum.
    """
    path = folder / str(table["file"])
    if unknown := sorted(set(table) - {"file", "scale", "clamp"}):
        raise RigError(
            f"outline file {path}: {', '.join(unknown)}: unknown key; the keys are file, and for"
            " the contour of a photograph scale and clamp"
        )
    pixels = "scale" in table or "clamp" in table
    points, *ensemble = [_pixels(path, table)] if pixels else _lengths(path)
    found = _document(path, points)
    if ensemble:
        found["ensemble"] = [_document(path, own, n) for n, own in enumerate(ensemble, 1)]
    return found


def _document(path: Path, points: Floats, member: int = 0) -> dict[str, Any]:
    try:
        edges = zip(("x", "top", "bottom"), split(points), strict=True)
    except ValueError as error:
        of = f" member {member}:" * bool(member)
        raise RigError(f"outline file {path}:{of} {error}") from error
    return {name: [f"{value!r} m" for value in edge.tolist()] for name, edge in edges}


def outline_text(contours: Sequence[Floats]) -> str:
    """Return an outline file of a contour [m] and those of its ensemble, each of shape (n, 2)."""
    rows = ["member,x [um],z [um]"]
    for number, contour in enumerate(contours):
        rows += [f"{number},{1e6 * x:.4f},{1e6 * z:.4f}" for x, z in contour.tolist()]
    return "\n".join(rows) + "\n"


def split(contour: Floats) -> tuple[Floats, Floats, Floats]:
    """Split a closed contour into x, top and bottom from the clamp to the tip.

    Args:
        contour: Points in order around the plectrum, clamp at x = 0, m, shape (n, 2).

    Returns:
        x, top and bottom [m], each of shape (m,), top[0] + bottom[0] = 0.

    Raises:
        ValueError: The contour crosses itself, folds back, has too few points or does not
            reach from the clamp to a tip.
    """
    contour = contour[np.any(contour != np.roll(contour, 1, 0), 1)]
    if len(contour) < LEAST_POINTS:
        raise ValueError(
            f"{len(contour)} different points are too few for a contour; trace at least"
            f" {LEAST_POINTS} around the complete plectrum"
        )
    low, high = float(contour[:, 0].min()), float(contour[:, 0].max())
    if high <= 0 or low > 0.02 * high:
        raise ValueError(
            f"the contour reaches from x = {1e3 * low:.4g} to {1e3 * high:.4g} mm, which is not"
            " from the clamp at 0 mm to a tip; subtract the clamp's position from every x"
        )
    if (crossing := _crossing(contour)) is not None:
        raise ValueError(
            f"the contour crosses itself near x = {1e3 * crossing[0]:.4g} mm,"
            f" z = {1e3 * crossing[1]:.4g} mm; order its points once around the plectrum"
        )
    start = max(low, 0.0)
    corners = np.unique(contour[:, 0])
    x = np.concatenate([[start], corners[(corners > start) & (corners < high)], [high]])
    many = len(x) > 101
    if many:
        x = np.linspace(start, high, 1001)
    else:
        x = x[np.append(True, np.diff(x) > 1e-4 * (high - start))]
        x[-1] = high
    top, bottom = np.array([_heights(contour, place) for place in x]).T
    return _from_clamp(*(_thinned(x, top, bottom) if many else (x, top, bottom)))


def _thinned(x: Floats, top: Floats, bottom: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the least-squares polyline with few vertices for each edge."""
    from scipy.interpolate import make_lsq_spline

    places = np.linspace(x[0], x[-1], 17)  # Few, which averages out single pixels
    knots = np.concatenate([[x[0]], places, [x[-1]]])
    edges = (make_lsq_spline(x, edge, knots, k=1) for edge in (top, bottom))
    top, bottom = (edge(places) for edge in edges)
    return places, top, bottom


def _from_clamp(x: Floats, top: Floats, bottom: Floats) -> tuple[Floats, Floats, Floats]:
    """Start at the clamp with the mid-line at 0, and give the tip its smallest thickness."""
    if x[0] > 0:  # by 2 % of the length at most: the first section is the clamp's
        x = np.concatenate([[0.0], x[1:]])
    if top[0] <= bottom[0] and len(x) > 2:  # a rounded butt traced to a point
        top[0], bottom[0] = top[1], bottom[1]
    middle = (top[0] + bottom[0]) / 2
    # The tip has at least 5 % of the thickness at the clamp.
    lack = max(0.05 * (top[0] - bottom[0]) - (top[-1] - bottom[-1]), 0.0)
    top[-1], bottom[-1] = top[-1] + lack / 2, bottom[-1] - lack / 2
    return x, top - middle, bottom - middle


def _heights(contour: Floats, x: float) -> tuple[float, float]:
    """Return top and bottom of a contour at one x, where the contour must pass exactly twice."""
    begin, end = contour, np.roll(contour, -1, 0)
    left, right = np.minimum(begin[:, 0], end[:, 0]), np.maximum(begin[:, 0], end[:, 0])
    at_x = (left <= x) & (x <= right)
    begin, end = begin[at_x], end[at_x]
    steep = begin[:, 0] == end[:, 0]
    fraction = (x - begin[:, 0]) / np.where(steep, 1, end[:, 0] - begin[:, 0])
    heights = np.where(steep, begin[:, 1], begin[:, 1] + fraction * (end[:, 1] - begin[:, 1]))
    heights = np.concatenate([heights, end[steep, 1]])
    top, bottom = float(heights.max()), float(heights.min())
    span = contour[:, 0].max()
    # Half open, so that a point between two edges counts once.
    passed = np.sum((left[at_x] <= x) & (x < right[at_x]))
    if passed > 2 and ENDS * span < x < (1 - ENDS) * span:
        raise ValueError(
            f"the contour folds back over itself at x = {1e3 * x:.4g} mm, where it passes more"
            " than twice; smooth it, or rotate the picture"
        )
    return top, bottom


def _crossing(contour: Floats) -> Floats | None:
    """Return the point where two edges that are not adjacent cross, or None."""
    begin, end = contour, np.roll(contour, -1, 0)
    along = end - begin
    count = len(contour)
    for i in range(count - 2):
        others = np.arange(i + 2, count if i else count - 1)
        offset = begin[others] - begin[i]
        cross = along[i, 0] * along[others, 1] - along[i, 1] * along[others, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            here = (offset[:, 0] * along[others, 1] - offset[:, 1] * along[others, 0]) / cross
            there = (offset[:, 0] * along[i, 1] - offset[:, 1] * along[i, 0]) / cross
        hit = (here >= 0) & (here <= 1) & (there >= 0) & (there <= 1)
        if hit.any():
            return begin[i] + here[hit][0] * along[i]
    return None


def _lengths(path: Path) -> list[Floats]:
    """Read a tracing [m], and those of its ensemble."""

    def read(name: str, text: str) -> float:
        return parse_quantity(text, units[name])

    units, example = {"x": "m", "z": "m"}, "x [mm], z [mm]"
    rows, _ = read_rows(path, f"outline file {path}", RigError)
    if rows and any(cell.strip() == "member" for cell in rows[0]):
        units, example = {"member": "", **units}, f"member, {example}"
    table = read_columns(path, "outline file", units, example, read)
    points = np.column_stack([table["x"], table["z"]])
    member = np.array(table.get("member", np.zeros(len(points))))
    numbers = np.unique(member)
    if not np.array_equal(numbers, np.arange(len(numbers))):
        raise RigError(
            f"outline file {path}: member: the numbers are not 0, 1, 2 and so on; 0 is the outline,"
            " the others are its ensemble"
        )
    return [points[member == number] for number in numbers] or [points]


def _pixels(path: Path, table: Mapping[str, Any]) -> Floats:
    """Read a photograph's contour; return it in m from its clamp, the tip at positive x."""
    faults = []
    try:
        scale = parse_quantity(str(table.get("scale", "")), "m")
        if scale <= 0:
            raise ValueError(f"{shown(table['scale'])} is not above 0 mm")
    except ValueError as error:
        scale = math.nan
        faults.append(f'scale: {error}; give the length of one pixel, scale = "0.01 mm"')
    clamp = table.get("clamp")
    clamp = clamp if isinstance(clamp, list) else []
    if len(clamp) != 2 or not all(isinstance(c, int | float) and math.isfinite(c) for c in clamp):
        faults.append(
            f"clamp: {shown(table.get('clamp'))} is refused; give column and row of the pixel at"
            " the centre of the clamp, clamp = [212, 640]"
        )
    if faults:
        raise RigError(f"outline file {path}: " + "\n  ".join(faults))

    def read(_: str, text: str) -> float:
        number, _, unit = text.rpartition(" ")
        if unit not in ("px", "pixel", "pixels"):
            raise ValueError(f"{shown(text)} is not a number of pixels")
        if not math.isfinite(value := float(number)):
            raise ValueError(f"{shown(text)} is not finite")
        return value

    cells = read_columns(path, "outline file", {"x": "px", "y": "px"}, "x [px], y [px]", read)
    x, y = np.array(cells["x"]), np.array(cells["y"])
    if len(x):
        x, y = x - clamp[0], clamp[1] - y
        if -x.min() > x.max():
            x = -x
    return scale * np.column_stack([x, y])
