"""Compute the table of one plectrum shape by finite elements."""

from dataclasses import replace

import numpy as np

from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.cantilever import FRICTION_MAX
from sautereau.analysis.model.plectrum.fe.load import patch_at, section_at
from sautereau.analysis.model.plectrum.fe.mesh import plectrum_grid
from sautereau.analysis.model.plectrum.fe.solve import Body, newton, rate, solve_loads
from sautereau.analysis.model.plectrum.profile import Profile
from sautereau.analysis.model.plectrum.table import Samples, nodes, through
from sautereau.analysis.model.plectrum.tapered import laws, load_range, samples
from sautereau.rig.progress import tracked

ACCURACY = 4e-4
"""Dimensionless; error of a table, relative to displacement and rotation, below which more
solutions are not tried."""
_SIZES = ((3, 4, 5), (3, 7, 6), (4, 12, 7))
"""Numbers of drags, positions and loads, tried one after another until the table is accurate."""
LOAD_LIMIT = 2.0
"""Largest load f = F L^2 / EI, dimensionless; EI follows from the plectrum's rotation under a small
load at its tip. A uniform plectrum turns by 56 degrees at this load."""
STRAIN_LIMIT = 0.2
"""Largest strain of the edges at the clamp, which limits the load of thick plectra."""


class Solver:
    """The contact's displacement at any position and load, directly by finite elements."""

    def __init__(self, profile: Profile, poisson_ratio: float):
        self.profile = profile
        self.body = Body(plectrum_grid(profile), poisson_ratio)
        frictionless = patch_at(self.body.grid, 1.0, profile.patch)
        bent = rate(self.body, frictionless, 0.0, np.zeros(self.body.size))
        # The rotation under a small load F at the tip is F L^2 / 2 EI, which is f / 2. The moment
        # F L gives the edges the strain F L h / 2 EI, which is f h / 2 L.
        flexibility = -2 * section_at(self.body.grid, 1.0).rotation_rate(bent)
        self.unit = profile.clamp_thickness**3 / 12
        """Load q = 1, F s^2 over EI at the clamp, in E W L^3."""
        most = min(LOAD_LIMIT, 2 * STRAIN_LIMIT / profile.clamp_thickness)
        self.limit = most / flexibility / self.unit
        """Largest load q."""

    def laws(self, places: Floats, loads: Floats, drags: Floats) -> Floats:
        """Return x/s, z/(s q) and theta/q, as `sautereau.analysis.model.plectrum.tapered.laws`.

        Raises:
            ModelError: No equilibrium is found.
        """
        found = np.empty((3, len(drags), len(loads), len(places)))
        for number, s in enumerate(tracked(places.tolist())):
            found[..., number] = self._laws_at(s, loads, drags)
        return found

    def _laws_at(self, s: float, loads: Floats, drags: Floats) -> Floats:
        patch = patch_at(self.body.grid, s, self.profile.patch)
        section, forces = patch.section, self.unit * loads / s**2
        height, slope, _ = self.profile.contact_line(s)
        tilt = float(np.arctan(slope))
        # Of the mesh, which is straight between the edges of its columns; the outline may not be.
        middle = section.mean @ self.body.grid.nodes[section.nodes, 1]
        arm = float(height) - middle + self.profile.clamp_middle
        straight = solve_loads(self.body, patch, forces)
        found = np.empty((3, len(drags), len(loads)))
        for row, drag in enumerate(drags.tolist()):
            # Of a load on a sloping top, the parts along the normal and the tangent of the section.
            dragged = replace(patch, drag=float(np.tan(tilt + np.arctan(drag))))
            pressed = forces * (np.cos(tilt) - drag * np.sin(tilt))
            for column, (q, force) in enumerate(zip(loads, pressed.tolist(), strict=True)):
                u = newton(self.body, dragged, force, straight[column])
                if u is None:
                    u = solve_loads(self.body, dragged, pressed[: column + 1])[-1]
                x, z = section.displacement(u)
                turned = section.rotation(u)
                x, z = x - arm * np.sin(turned), z + arm * (np.cos(turned) - 1)
                found[:, row, column] = 1 + x / s, z / (s * q), turned / q
        return found


def build(profile: Profile, poisson_ratio: float, nearest: float) -> Samples:
    """Solve at a few positions, loads and drags, and add what differs to the elastica's table.

    The elastica with EI(s) has the shape of the solution; what it neglects, shear and the corners
    of the outline, is a small and smooth part of it.

    Raises:
        ModelError: The elements find no equilibrium.
    """
    solver = Solver(profile, poisson_ratio)
    elastica = samples(profile, nearest, min(solver.limit, load_range(profile)), True)
    *others, places = elastica.nodes
    targets = (*others, places.ravel())
    ends = ((-FRICTION_MAX, FRICTION_MAX), (0.0, elastica.q_max), (nearest, 1.0))
    found, exact = elastica, solver.laws(*elastica.probes)
    for size in _SIZES:
        drags, loads, positions = (nodes(n, *end) for n, end in zip(size, ends, strict=True))
        at = positions, loads, drags
        added = solver.laws(*at) - laws(profile, *at, at_surface=True)
        added[0] /= loads[:, None]  # without load there is no shortening
        spread = (
            through(count, target, *end)
            for count, target, end in zip(size, targets, ends, strict=True)
        )
        added = np.einsum("lgnk,dg,qn,pk->ldqp", added, *spread, optimize=True)
        added[0] *= targets[1][:, None]
        found = replace(elastica, laws=elastica.laws + added.reshape(elastica.laws.shape))
        found = found.checked(exact)
        if found.error <= ACCURACY:
            break
    return found
