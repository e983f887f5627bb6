"""Mesh and deformed shape of a plectrum under its string."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.fe.mesh import Grid
from sautereau.analysis.model.plectrum.fe.profile import profile_of
from sautereau.rig.instrument import Plectrum

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STEPS = 6
"""Of the load, on the way to the one that is drawn."""


def plot_mesh(path: str | Path, plectrum: Plectrum, force: float, s: float) -> None:
    """Draw a plectrum's mesh, undeformed and under a load, to a file.

    Args:
        path: Of the picture; its ending chooses the format.
        plectrum: Of the rig.
        force: N, normal to the deformed surface.
        s: m, position of the string from the clamp.

    Raises:
        ModelError: There is no equilibrium, or s or force are out of range.
    """
    mesh_figure(plectrum, force, s).savefig(path, dpi=150)


def mesh_figure(plectrum: Plectrum, force: float, s: float) -> "Figure":
    """Return that drawing."""
    from matplotlib.figure import Figure

    from sautereau.analysis.model.plectrum.fe.body import Body
    from sautereau.analysis.model.plectrum.fe.load import patch_at, section_at
    from sautereau.analysis.model.plectrum.fe.mesh import plectrum_grid
    from sautereau.analysis.model.plectrum.fe.solve import solve_loads

    length = plectrum.length
    if not (0 < s <= length and 0 < force < np.inf):
        raise ModelError(
            f"plectrum: a force of {force:.4g} N at {1e3 * s:.4g} mm cannot be drawn; give a"
            f" force above 0 N and a position within 0 to {1e3 * length:.4g} mm"
        )
    profile = profile_of(plectrum)
    grid = plectrum_grid(profile)
    body = Body(grid, plectrum.poisson_ratio)
    patch = patch_at(grid, s / length, profile.patch, plectrum.friction)
    scale = plectrum.youngs_modulus * plectrum.width * length
    u = solve_loads(body, patch, np.linspace(0, force / scale, STEPS + 1)[1:])[-1]
    section = section_at(grid, s / length)

    figure = Figure(figsize=(9, 4), layout="constrained")
    axes = figure.subplots()
    unit = 1e3 * length
    rest, bent = grid.nodes * unit, (grid.nodes + u.reshape(-1, 2)) * unit
    _draw(axes, grid, rest, "0.8", 0.4)
    _draw(axes, grid, bent, "tab:blue", 0.5)
    point = patch.shares @ bent
    away = point - 0.2 * unit * patch.direction(u)
    axes.annotate(
        f"{force:.3g} N at {1e3 * s:.4g} mm", (point[0], point[1]), (away[0], away[1]),
        color="tab:red", ha="center", va="bottom",
        arrowprops={"arrowstyle": "->", "color": "tab:red", "linewidth": 1.8},
    )  # fmt: skip
    turned = np.degrees(section.rotation(u))
    x, z = section.displacement(u) * unit
    axes.set(
        aspect="equal", xlabel="from the clamp (mm)", ylabel="height (mm)",
        title=f"{len(grid.x) - 1} x {grid.layers} elements; the section under the load moves by"
        f" {x:.3f}, {z:.3f} mm and turns by {turned:.2f} deg",
    )  # fmt: skip
    axes.axvline(0, color="0.3", linewidth=3)
    axes.margins(0.12)
    return figure


def _draw(axes, grid: Grid, nodes: Floats, colour: str, width: float) -> None:
    """Draw the elements' edges, curved as they are."""
    at = nodes.reshape(-1, grid.height, 2)
    for lines in (at[:, ::2].transpose(1, 0, 2), at[::2]):
        for line in lines:
            axes.plot(*line.T, color=colour, linewidth=width)
