"""The release of a frictionless string by CalculiX: plane stress with large displacements.

An independent solution by another program, for outlines of which the elastica of `pluck.py` is an
approximation. It needs `ccx` (Debian: `apt-get install calculix-ccx`).
`python -m tests.oracles.calculix` writes the releases of two outlines to `calculix.csv`: the mesh
changes them by 0.01 %, the choice of patches for the extrapolation to the tip by up to 0.3 %.

Lengths are in mm in CalculiX's input, in m elsewhere.
"""

from __future__ import annotations

import csv
import itertools
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from math import atan, atan2, cos, hypot, sin
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from tests.oracles.outline import Outline
from tests.oracles.pluck import pluck, string_stiffness

LOADED = 4  # Number of elements under the load
SLICE = 0.01
"""Width in mm of the slice that is computed. CalculiX makes solids of its plane elements, with a
displacement in the plane that is constant over the width: at a width near the thickness they are
5 % too stiff in bending, because they resist the anticlastic curvature."""
UNIT = 1e9
"""Units of force per newton in the input: CalculiX takes any residual below about 1e-6 units for
convergence, which at newtons leaves errors of 1 % in the direction of the load."""


@dataclass(frozen=True)
class Loads:
    """Deformation by increasing loads at one position; arrays over the loads, the first is 0."""

    position: float
    """Middle of the patch under the load, in m."""
    force: np.ndarray
    """Resultant of the pressure, in N."""
    angle: np.ndarray
    """By which the surface under the load points down, in rad: the resultant's direction."""
    rotation: np.ndarray
    """Mean of the section under the load, in rad."""
    x: np.ndarray
    z: np.ndarray
    """Middle of that section in m, in the clamp's frame."""


@dataclass(frozen=True)
class Mesh:
    """Quadrilaterals of 8 nodes between two edges."""

    nodes: np.ndarray
    """Shape (n, 2): x and z in mm."""
    elements: np.ndarray
    """Shape (m, 8): indices of nodes, corners anticlockwise from the lower left, then sides."""
    columns: np.ndarray
    """Positions in mm of the vertical lines between elements."""
    lines: list[np.ndarray]
    """Indices of the nodes of each of them, from below."""
    rows: int


def mesh(outline: Outline, size: float, rows: int, fine: int) -> Mesh:
    """Divide an outline into elements of about `size` (m) in x, and in `rows` over the height.

    The last `fine` elements before the tip are of that size exactly.
    """
    start = outline.length - fine * size
    ends = [0.0, *(b for b in outline.breaks if b < start - size / 2), start, outline.length]
    pieces = [
        np.linspace(a, b, max(round((b - a) / size), 1) + 1)[1:]
        for a, b in itertools.pairwise(ends)
    ]
    columns = np.concatenate([[0.0], *pieces])
    x = np.interp(np.arange(2 * len(columns) - 1) / 2, np.arange(len(columns)), columns)
    index = -np.ones((len(x), 2 * rows + 1), dtype=int)
    nodes = []
    for i, at in enumerate(x):
        low, high = outline.bottom(at), outline.top(at)
        for j in range(2 * rows + 1):
            if i % 2 and j % 2:
                continue  # the middle of an element has no node
            index[i, j] = len(nodes)
            nodes.append((at * 1e3, (low + (high - low) * j / (2 * rows)) * 1e3))
    corners = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)]
    elements = [
        [index[2 * i + di, 2 * j + dj] for di, dj in corners]
        for i in range(len(columns) - 1)
        for j in range(rows)
    ]
    lines = [index[2 * i] for i in range(len(columns))]
    return Mesh(np.array(nodes), np.array(elements), columns * 1e3, lines, rows)


def run(
    body: Mesh,
    end: int,
    loads: Sequence[float],
    *,
    modulus: float,
    poisson: float,
    width: float,
    loaded: int = LOADED,
) -> Loads:
    """Press on the `loaded` elements before column `end`, by a pressure normal to the surface.

    Args:
        body: mesh of the plectrum.
        end: index of the column at which the loaded patch ends.
        loads: one after the other, about, in N. The results have their exact values.
        modulus: in Pa.
        poisson: ratio, dimensionless.
        width: in m.
        loaded: number of elements, even.
    """
    middle = end - loaded // 2
    line = body.lines[middle]
    patch = np.linalg.norm(
        body.nodes[body.lines[end][-1]] - body.nodes[body.lines[end - loaded][-1]]
    )
    area, scale = patch * SLICE, UNIT * SLICE / (width * 1e3)
    pressed = [(i + 1) * body.rows for i in range(end - loaded, end)]
    text = ["*NODE, NSET=ALL"]
    text += [f"{i + 1}, {x:.12g}, {z:.12g}, 0" for i, (x, z) in enumerate(body.nodes)]
    text += ["*ELEMENT, TYPE=CPS8, ELSET=BODY"]
    text += [f"{i + 1}, " + ", ".join(str(n + 1) for n in e) for i, e in enumerate(body.elements)]
    for name, members in (("CLAMP", body.lines[0]), ("LINE", line)):
        text += [f"*NSET, NSET={name}", *(f"{n + 1}," for n in members)]
    text += [
        "*MATERIAL, NAME=PLECTRUM",
        "*ELASTIC",
        f"{modulus * 1e-6 * UNIT:.12g}, {poisson:.12g}",
        "*SOLID SECTION, ELSET=BODY, MATERIAL=PLECTRUM",
        f"{SLICE:.12g}",
        "*BOUNDARY",
        "CLAMP, 1, 2",
    ]
    for load in loads:
        pressure = load * scale / area
        text += [
            "*STEP, NLGEOM",
            "*CONTROLS, PARAMETERS=FIELD",
            "1e-8,1e-8,,,1e-8,1e-12,1e-8,1e-12",
            "*STATIC, DIRECT",
            "1., 1.",
            "*DLOAD",
            *(f"{e}, P3, {pressure:.12g}" for e in pressed),
            "*NODE PRINT, NSET=LINE",
            "U",
            "*NODE PRINT, NSET=CLAMP, TOTALS=ONLY",
            "RF",
            "*END STEP",
        ]
    text.append("")
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "pluck.inp").write_text("\n".join(text))
        done = subprocess.run(
            ["ccx", "pluck"], cwd=folder, capture_output=True, text=True, check=False
        )
        result = Path(folder) / "pluck.dat"
        if done.returncode or "*ERROR" in done.stdout or not result.exists():
            raise RuntimeError(f"ccx failed: {done.stdout[-2000:]}")
        moved, reactions = _read(result.read_text())
    return _loads(body, middle, loaded, moved, [(x / scale, z / scale) for x, z in reactions])


def _read(text: str) -> tuple[list[dict[int, tuple[float, float]]], list[tuple[float, float]]]:
    """Return displacements in mm by node, and reactions in N, of each increment."""
    moved: list[dict[int, tuple[float, float]]] = []
    reactions: list[tuple[float, float]] = []
    kind = ""
    for row in text.splitlines():
        if "displacements" in row:
            kind = "U"
            moved.append({})
        elif "total force" in row:
            kind = "RF"
        elif row.strip():
            values = row.split()
            if kind == "U":
                moved[-1][int(values[0]) - 1] = float(values[1]), float(values[2])
            else:
                reactions.append((float(values[0]), float(values[1])))
    return moved, reactions


def _loads(
    body: Mesh,
    middle: int,
    loaded: int,
    moved: list[dict[int, tuple[float, float]]],
    reactions: list[tuple[float, float]],
) -> Loads:
    line = body.lines[middle]
    base = (body.nodes[body.lines[0][0], 1] + body.nodes[body.lines[0][-1], 1]) / 2
    height = body.nodes[line, 1] - body.nodes[line, 1].mean()
    top = [lines[-1] for lines in body.lines]
    ends = body.nodes[top[middle + loaded // 2]] - body.nodes[top[middle - loaded // 2]]
    rows = [
        (
            0.0,
            atan(-ends[1] / ends[0]),
            0.0,
            body.columns[middle] * 1e-3,
            (body.nodes[line, 1].mean() - base) * 1e-3,
        )
    ]
    for places, (right, up) in zip(moved, reactions, strict=True):
        points = body.nodes[line] + [places[n] for n in line]
        # the section's direction by least squares over its nodes
        across = height @ points
        centre = points.mean(axis=0)
        rows.append(
            (
                hypot(right, up),
                atan2(right, up),
                atan2(across[0], across[1]),
                centre[0] * 1e-3,
                (centre[1] - base) * 1e-3,
            )
        )
    force, angle, rotation, x, z = np.array(rows).T
    return Loads(body.columns[middle] * 1e-3, force, angle, rotation, x, z)


def release(
    outline: Outline,
    *,
    loads: Sequence[float],
    modulus: float,
    poisson: float,
    width: float,
    overlap: float,
    stiffness: float,
    radius: float,
    before_tip: Sequence[int] = (2, 4, 6, 8),
    rows: int = 8,
    refine: int = 1,
) -> dict[str, float]:
    """Return the release at the tip without friction, contact `surface`; SI units.

    The load is spread over a patch of half the thickness at the clamp. Its middle cannot reach
    the tip: contact point, angle and rotation are extrapolated from patches before it.

    Args:
        outline: shape of the plectrum.
        loads: in N, on both sides of the force at release.
        modulus: in Pa.
        poisson: ratio, dimensionless.
        width: in m.
        overlap: from the string's centre at rest to the tip, in m.
        stiffness: of the string in N/m.
        radius: of the wire in m.
        before_tip: numbers of elements between the patches and the tip.
        rows: number of elements over the height.
        refine: number of elements that replace one, in each direction.
    """
    length = outline.length
    patch = (outline.top(0.0) - outline.bottom(0.0)) / 2
    body = mesh(outline, patch / LOADED / refine, rows * refine, 4 * LOADED * refine)
    last = len(body.columns) - 1
    runs = [
        run(
            body,
            last - n * refine,
            loads,
            modulus=modulus,
            poisson=poisson,
            width=width,
            loaded=LOADED * refine,
        )
        for n in before_tip
    ]

    def at_tip(force: float) -> tuple[float, float, float, float]:
        """Return X, Z of the string's centre in m, angle and rotation in rad."""
        rows = []
        for loads in runs:
            s, t = loads.position, outline.top(loads.position) - outline.bottom(loads.position)
            x, z, angle, rotation = (
                float(CubicSpline(loads.force, values)(force))
                for values in (loads.x, loads.z, loads.angle, loads.rotation)
            )
            x += t / 2 * sin(rotation) + radius * sin(angle)
            z += t / 2 * cos(rotation) + radius * cos(angle)
            rows.append((s - length, x - s, z, angle, rotation))
        s, *columns = np.array(rows).T
        x, z, angle, rotation = (
            float(np.polyfit(s / length, c, min(len(s) - 1, 2))[-1]) for c in columns
        )
        return length + x, z, angle, rotation

    def gap(force: float) -> float:
        x, _, angle, _ = at_tip(force)
        return x - (length - overlap) - force * sin(angle) / stiffness

    force = float(brentq(gap, min(loads), max(loads), xtol=1e-12))
    _, z, angle, rotation = at_tip(force)
    lift = force * cos(angle) / stiffness
    return {
        "height": lift - z + first_height(outline, length - overlap, radius),
        "force": force,
        "lift": lift,
        "shift": force * sin(angle) / stiffness,
        "angle": angle,
        "rotation": rotation,
    }


def first_height(outline: Outline, x: float, radius: float) -> float:
    """Return the height in m over the middle of the clamp of a wire's centre at x on the top."""
    base = (outline.top(0.0) + outline.bottom(0.0)) / 2
    grid = np.linspace(x - radius, min(x + radius, outline.length), 20001)
    return max(outline.top(s) + (radius**2 - (s - x) ** 2) ** 0.5 for s in grid[1:-1]) - base


def main() -> None:
    """Write `calculix.csv`: the releases of two outlines in SI units, on two meshes."""
    from tests.oracles.cases import arched, wedge

    case = {
        "modulus": 2.9e9,
        "width": 0.75e-3,
        "overlap": 0.263e-3,
        "radius": 0.155e-3,
        "stiffness": string_stiffness(66.95, 0.46, 0.108),
    }
    with (Path(__file__).parent / "calculix.csv").open("w", newline="") as file:
        quantities = ["height", "force", "lift", "shift", "angle", "rotation"]
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["shape", "rows", *quantities])
        for name, outline in (("wedge", wedge()), ("arched", arched())):
            elastica = pluck(outline, nodes=8, **case)
            loads = [f * elastica.force for f in (0.5, 0.9, 1.0, 1.1)]
            for refine in (1, 2):
                result = release(outline, loads=loads, poisson=0.35, refine=refine, rows=6, **case)
                values = [f"{result[quantity]:.6g}" for quantity in quantities]
                table.writerow([name, 6 * refine, *values])


if __name__ == "__main__":
    main()
