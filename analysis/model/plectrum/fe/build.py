"""Compute the map of one plectrum shape by finite elements."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.polynomial import chebyshev

from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.cantilever import FRICTION_MAX
from sautereau.analysis.model.plectrum.fe.cache import (
    LOAD_LIMIT,
    MARGIN,
    STRAIN_LIMIT,
    DisplacementSeries,
)
from sautereau.analysis.model.plectrum.fe.load import patch_at, section_at
from sautereau.analysis.model.plectrum.fe.profile import Profile, plectrum_grid
from sautereau.analysis.model.plectrum.fe.solve import Body, newton, rate, solve_loads
from sautereau.rig.progress import tracked

ACCURACY = 2e-4
"""Dimensionless; error of the series between their nodes, relative to rotation, displacement and
shortening, below which more nodes are not tried. The specified accuracy is 5e-4."""
_SIZES = ((6, 8), (9, 10), (17, 12))
"""Numbers of positions and loads, tried one after another until the series are accurate."""
_DRAGS = 4  # Nodes over the drags; 3 leave an error of 7e-4


class Solver:
    """The contact's displacement at any position and load, directly by finite elements."""

    def __init__(self, profile: Profile, poisson_ratio: float):
        self.profile = profile
        self.body = Body(plectrum_grid(profile), poisson_ratio)
        frictionless = patch_at(self.body.grid, 1.0, profile.patch)
        bent = rate(self.body, frictionless, 0.0, np.zeros(self.body.size))
        # The rotation under a small load F at the tip is F L^2 / 2 EI, which is f / 2.
        self.load = -0.5 / section_at(self.body.grid, 1.0).rotation_rate(bent)
        """Force at f = 1, in E W L."""
        # The moment F L gives the edges the strain F L h / 2 EI, which is f h / 2 L.
        self.limit = min(LOAD_LIMIT, 2 * STRAIN_LIMIT / profile.clamp_thickness)
        """Dimensionless, largest f."""

    def contact(self, s: float, loads: Floats, drags: Sequence[float] = (0.0,)) -> Floats:
        """Return displacements x, z [lengths] and rotation [rad], shape (3, drags, n).

        Args:
            s: Position [lengths].
            loads: f, increasing, shape (n,).
            drags: T, the force along the section towards the tip over the one normal to it.

        Raises:
            ModelError: No equilibrium is found.
        """
        patch, forces = patch_at(self.body.grid, s, self.profile.patch), self.load * loads
        section = patch.section
        # Of the mesh, which is straight between the edges of its columns; the outline may not be.
        middle = section.mean @ self.body.grid.nodes[section.nodes, 1]
        arm = self.profile.contact_line(s)[0] - middle + self.profile.clamp_middle
        straight = solve_loads(self.body, patch, forces)
        found = np.empty((3, len(drags), len(loads)))
        for row, drag in enumerate(drags):
            dragged = replace(patch, drag=drag)
            for column, (u, force) in enumerate(zip(straight, forces.tolist(), strict=True)):
                if drag:
                    u = newton(self.body, dragged, force, u)
                    if u is None:
                        u = solve_loads(self.body, dragged, forces[: column + 1])[-1]
                x, z = section.displacement(u)
                turned = section.rotation(u)
                moved = x - arm * np.sin(turned), z + arm * (np.cos(turned) - 1), turned
                found[:, row, column] = moved
        return found


def build(profile: Profile, poisson_ratio: float, nearest: float) -> DisplacementSeries:
    """Solve on a grid of positions from ``nearest`` to the tip, of loads and drags; fit the series.

    The drags are those of every coefficient of friction up to `FRICTION_MAX`.

    Raises:
        ModelError: The elements find no equilibrium.
    """
    solver = Solver(profile, poisson_ratio)
    # Seen from the section, a load normal to a sloping top has a part along it.
    tilts = np.arctan(profile.contact_line(np.linspace(nearest, 1.0, 401))[1])
    lean = float(np.arctan(FRICTION_MAX))
    least, most = float(np.tan(tilts.min() - lean)), float(np.tan(tilts.max() + lean))
    for size in _SIZES[:-1]:
        table = _fitted(solver, nearest, (least, most), size)
        if table.error <= ACCURACY:
            return table
    return _fitted(solver, nearest, (least, most), _SIZES[-1])


def _fitted(
    solver: Solver, nearest: float, ends: tuple[float, float], size: tuple[int, int]
) -> DisplacementSeries:
    """Return the series through solutions at some positions, loads and drags, with its error.

    Args:
        ends: Smallest and largest drag.
        size: Numbers of positions and loads.
    """
    s, f = _nodes(size[0], nearest, 1.0), _nodes(size[1], 0.0, solver.limit * MARGIN)
    drags = _nodes(_DRAGS, *ends).tolist()
    values = np.stack([solver.contact(p, f, drags) / f for p in tracked([*s])], 2)
    found = DisplacementSeries(_series(values), nearest, *ends, solver.load, solver.limit, 0.0)
    return replace(found, error=_error(found, solver))


def _nodes(count: int, low: float, high: float) -> Floats:
    """Return Chebyshev's nodes between two ends, increasing."""
    return (low + high) / 2 + (high - low) / 2 * chebyshev.chebpts1(count)


def _series(values: Floats) -> Floats:
    """Return the series through values at `_nodes`, shape (3, drags, positions, loads)."""
    for axis in (1, 2, 3):
        count = values.shape[axis]
        basis = chebyshev.chebvander(chebyshev.chebpts1(count), count - 1)
        transform = np.linalg.inv(basis)
        values = np.moveaxis(np.tensordot(transform, values, (1, axis)), 0, axis)
    return values


def _error(table: DisplacementSeries, solver: Solver) -> float:
    """Return the largest relative error of a table between its nodes."""
    f = solver.limit * np.array([0.15, 0.5, 0.965])
    worst = 0.0
    for share, pulled in ((0.22, 0.9), (0.61, 0.3), (0.87, 0.0), (0.963, 0.6), (1.0, 0.5)):
        s = table.nearest + (1 - table.nearest) * share
        drag = table.least + (table.most - table.least) * pulled
        exact = solver.contact(s, f, [drag])[:, 0]
        found = table.values(np.full(3, s), f, np.full(3, drag))[0] * f
        scale = np.abs(exact)
        scale[0] += 0.02 * scale[1]  # of a carved plectrum, x may pass through zero
        worst = max(worst, float(np.max(np.abs(found - exact) / scale)))
    return worst
