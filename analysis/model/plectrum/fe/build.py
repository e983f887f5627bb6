"""Compute the map of one plectrum shape by finite elements."""

import numpy as np
from numpy.polynomial import chebyshev

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.fe.cache import (
    LOAD_LIMIT,
    MARGIN,
    STRAIN_LIMIT,
    DisplacementSeries,
)
from sautereau.analysis.model.plectrum.fe.load import patch_at, section_at
from sautereau.analysis.model.plectrum.fe.profile import Profile, plectrum_grid
from sautereau.analysis.model.plectrum.fe.solve import Body, rate, solve_loads
from sautereau.rig.progress import tracked

ACCURACY = 2e-4
"""Dimensionless; largest accepted error of the series between their nodes, relative to rotation,
displacement and shortening. The specified accuracy is 5e-4."""
_SIZES = ((9, 10), (17, 12), (33, 14))
"""Numbers of positions and loads, tried one after another until the series are accurate."""


class Solver:
    """The contact's displacement at any position and load, directly by finite elements."""

    def __init__(self, profile: Profile, poisson_ratio: float, friction: float):
        self.profile = profile
        self.friction = friction
        self.body = Body(plectrum_grid(profile), poisson_ratio)
        frictionless = patch_at(self.body.grid, 1.0, profile.patch)
        bent = rate(self.body, frictionless, 0.0, np.zeros(self.body.size))
        # The rotation under a small load F at the tip is F L^2 / 2 EI, which is f / 2.
        self.load = -0.5 / section_at(self.body.grid, 1.0).rotation_rate(bent)
        """Force at f = 1, in E W L."""
        # The moment F L gives the edges the strain F L h / 2 EI, which is f h / 2 L.
        self.limit = min(LOAD_LIMIT, 2 * STRAIN_LIMIT / profile.clamp_thickness)
        """Dimensionless, largest f."""

    def contact(self, s: float, loads: Floats) -> Floats:
        """Return displacements x, z [lengths] and rotation [rad] of the contact, shape (3, n).

        Args:
            s: Position [lengths].
            loads: f, increasing, shape (n,).

        Raises:
            ModelError: No equilibrium is found.
        """
        patch = patch_at(self.body.grid, s, self.profile.patch, self.friction)
        section = section_at(self.body.grid, s)
        arm = self.profile.contact_arm(s)
        found = []
        for u in solve_loads(self.body, patch, self.load * loads):
            x, z = section.displacement(u)
            turned = section.rotation(u)
            found.append([x - arm * np.sin(turned), z + arm * (np.cos(turned) - 1), turned])
        return np.array(found).T


def build(
    profile: Profile, poisson_ratio: float, friction: float, nearest: float
) -> DisplacementSeries:
    """Solve on a grid of positions from ``nearest`` to the tip and of loads; fit the series.

    Raises:
        ModelError: The elements find no equilibrium, or the outline is too rough for the
            largest series.
    """
    solver = Solver(profile, poisson_ratio, friction)
    positions, error = 0, np.inf
    for positions, loads in _SIZES:
        s, f = _nodes(positions, nearest, 1.0), _nodes(loads, 0.0, solver.limit * MARGIN)
        values = np.stack([solver.contact(place, f) / f for place in tracked([*s])], 1)
        table = DisplacementSeries(_series(values), nearest, solver.load, solver.limit)
        error = _error(table, solver)
        if error <= ACCURACY:
            return table
    raise ModelError(
        f"plectrum.outline: not smooth enough for a map: {positions} positions leave an error of"
        f" {100 * error:.2g} %, of {100 * ACCURACY:.2g} % allowed; smooth the outline"
    )


def _nodes(count: int, low: float, high: float) -> Floats:
    """Return Chebyshev's nodes between two ends, increasing."""
    return (low + high) / 2 + (high - low) / 2 * chebyshev.chebpts1(count)


def _series(values: Floats) -> Floats:
    """Return the Chebyshev series through values at `_nodes`, shape (fields, m, n)."""
    for axis in (1, 2):
        count = values.shape[axis]
        basis = chebyshev.chebvander(chebyshev.chebpts1(count), count - 1)
        transform = np.linalg.inv(basis)
        values = np.moveaxis(np.tensordot(transform, values, (1, axis)), 0, axis)
    return values


def _error(table: DisplacementSeries, solver: Solver) -> float:
    """Return the largest relative error of a table between its nodes."""
    reach = 1 - table.nearest
    f = solver.limit * np.array([0.15, 0.5, 0.965])
    worst = 0.0
    for s in table.nearest + reach * np.array([0.22, 0.61, 0.87, 0.963, 1.0]):
        exact = solver.contact(s, f)
        found = table.values(np.full(3, s), f)[0] * f
        scale = np.abs(exact)
        scale[0] += 0.02 * scale[1]  # of a carved plectrum, x may pass through zero
        worst = max(worst, float(np.max(np.abs(found - exact) / scale)))
    return worst
