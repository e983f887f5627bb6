"""Compute the table of one plectrum shape by finite elements, and its derivatives by cuts.

A cut takes material from the underside: it raises the bottom edge in proportion to its depth. At an
equilibrium u, where the load F f(u) is the internal force R(u), a cut by p changes u by
du/dp = K^-1 (F df/dp - dR/dp), with the tangent K of the load and the body at that u. The right
side is the difference of the out-of-balance forces at the same u on two meshes, so that a further
cut takes one more right side and no iteration.
"""

from collections.abc import Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.cantilever import FRICTION_MAX
from sautereau.analysis.model.plectrum.fe import solve
from sautereau.analysis.model.plectrum.fe.mesh import (
    Patch,
    grid_between,
    patch_at,
    plectrum_grid,
    section_at,
)
from sautereau.analysis.model.plectrum.profile import Profile
from sautereau.analysis.model.plectrum.table import Samples, nodes, through
from sautereau.analysis.model.plectrum.tapered import laws, load_range, samples
from sautereau.rig.progress import tracked

HALVINGS = 4  # Of the largest load, where a thick plectrum finds no equilibrium under it
DEPTH = 1e-7
"""In lengths, depth of a cut between whose meshes differences are taken. The tangent is that of the
uncut mesh: bending is so much softer than stretching that at 1e-5 this is 6 % of a derivative."""


class Solver:
    """The contact's displacement at any position and load, directly by finite elements.

    Args:
        cuts: Profiles of the same top and clamp whose undersides are cut by `DEPTH`.
    """

    def __init__(self, profile: Profile, material: solve.Elastic, cuts: Sequence[Profile] = ()):
        self.profile = profile
        grid = plectrum_grid(profile)
        self.body = solve.Body(grid, material)
        # On the columns of the uncut one: nodes only move up.
        self.cuts = [solve.Body(grid_between(cut, grid.x, grid.layers), material) for cut in cuts]
        frictionless = patch_at(self.body.grid, 1.0, profile.patch)
        bent = solve.rate(self.body, frictionless, 0.0, np.zeros(self.body.size))
        # The rotation under a small load F at the tip is F L^2 / 2 EI, which is f / 2. The moment
        # F L gives the edges the strain F L h / 2 EI, which is f h / 2 L.
        flexibility = -2 * section_at(self.body.grid, 1.0).rotation_rate(bent)
        self.unit = profile.clamp_thickness**3 / 12
        """Load q = 1, F s^2 over EI at the clamp, in E W L^3."""
        # F = F L^2 / EI of 2, where EI follows from the plectrum's rotation under a small load at
        # its tip: a uniform plectrum turns by 56 degrees.
        self.limit = 2.0 / flexibility / self.unit
        """Largest load q."""

    def laws(self, places: Floats, loads: Floats, drags: Floats) -> Floats:
        """Return x/s, z/(s q) and theta/q, as `sautereau.analysis.model.plectrum.tapered.laws`.

        Raises:
            ModelError: No equilibrium is found.
        """
        return self.laws_and_rates(places, loads, drags)[0]

    def laws_and_rates(self, places: Floats, loads: Floats, drags: Floats) -> Floats:
        """Return the laws, and after them their derivatives by the depth [lengths] of each cut.

        Returns:
            Shape (1 + cuts, 3, drags, loads, places).

        Raises:
            ModelError: No equilibrium is found.
        """
        found = np.empty((1 + len(self.cuts), 3, len(drags), len(loads), len(places)))
        for number, s in enumerate(tracked(places.tolist())):
            found[..., number] = self._laws_at(s, loads, drags)
        return found

    def _laws_at(self, s: float, loads: Floats, drags: Floats) -> Floats:
        patches = [patch_at(b.grid, s, self.profile.patch) for b in (self.body, *self.cuts)]
        patch, forces = patches[0], self.unit * loads / s**2
        _, slope, _ = self.profile.contact_line(s)
        tilt = float(np.arctan(slope))
        straight = solve.solve_loads(self.body, patch, forces)
        found = np.empty((1 + len(self.cuts), 3, len(drags), len(loads)))
        for row, drag in enumerate(drags.tolist()):
            # Of a load on a sloping top, the parts along the normal and the tangent of the section.
            across = float(np.tan(tilt + np.arctan(drag)))
            dragged, *cut = (replace(one, drag=across) for one in patches)
            pressed = forces * (np.cos(tilt) - drag * np.sin(tilt))
            for column, (q, force) in enumerate(zip(loads, pressed.tolist(), strict=True)):
                u = solve.newton(self.body, dragged, force, straight[column])
                if u is None:
                    u = solve.solve_loads(self.body, dragged, pressed[: column + 1])[-1]
                values = [self._law(s, q, self.body, dragged, u)]
                lacking = [
                    force * own.unit_load(u) - body.forces(u)
                    for body, own in zip(self.cuts, cut, strict=True)
                ]
                moved = solve.responses(self.body, dragged, force, u, lacking)
                for body, own, step in zip(self.cuts, cut, moved, strict=True):
                    values.append((self._law(s, q, body, own, u + step) - values[0]) / DEPTH)
                found[:, :, row, column] = values
        return found

    def _law(self, s: float, q: float, body: solve.Body, patch: Patch, u: Floats) -> Floats:
        """Return x/s, z/(s q) and theta/q of displacements, shape (3,)."""
        section, height = patch.section, float(self.profile.contact_line(s)[0])
        # Of the mesh, which is straight between the edges of its columns; the outline may not be.
        middle = section.mean @ body.grid.nodes[section.nodes, 1]
        arm = height - middle + self.profile.clamp_middle
        x, z = section.displacement(u)
        turned = section.rotation(u)
        x, z = x - arm * np.sin(turned), z + arm * (np.cos(turned) - 1)
        return np.array([1 + x / s, z / (s * q), turned / q])


@dataclass(frozen=True)
class Rates:
    """Derivatives of a table's laws by the depth of each cut, at Chebyshev's nodes."""

    laws: Floats
    """Shape (cuts, 3, drags, loads, positions)."""

    def moved(self, base: Samples, depths: Floats) -> Samples:
        """Return a table after cuts of small depths [lengths], shape (cuts,)."""
        return replace(base, laws=base.laws + _spread(np.tensordot(depths, self.laws, 1), base))


def build(
    profile: Profile, material: solve.Elastic, nearest: float, cuts: Sequence[Floats] = ()
) -> tuple[Samples, Rates]:
    """Return the table of a profile, and its derivatives by cuts of the underside.

    It is solved at a few positions, loads and drags, and what differs is added to the elastica's
    table. The elastica with EI(s) has the shape of the solution; what it neglects, shear and the
    corners of the outline, is a small and smooth part of it.

    Args:
        cuts: Depth of each at the profile's vertices per unit, 0 at the clamp.

    Raises:
        ModelError: The elements find no equilibrium.
    """
    cut = [replace(profile, bottom=profile.bottom + DEPTH * depth) for depth in cuts]
    solver = Solver(profile, material, cut)
    most = min(solver.limit, load_range(profile))
    if material.shear is not None:
        # Fibres buckle under a pressure as large as the shear modulus: no equilibrium was found at
        # 1.3 to 1.7 times it. The load q gives the edges at the clamp the strain q h / 2 s.
        most = min(most, 2 * nearest * material.shear / profile.clamp_thickness)
    for halvings in range(HALVINGS):
        with suppress(ModelError):
            return _up_to(most / 2**halvings, solver, nearest)
    return _up_to(most / 2**HALVINGS, solver, nearest)


def _up_to(most: float, solver: Solver, nearest: float) -> tuple[Samples, Rates]:
    """Return the table for loads q up to a largest one, and its derivatives, as `build` does."""
    profile, uncut = solver.profile, copy(solver)
    uncut.cuts = []
    elastica = samples(profile, nearest, most, True)
    ends = ((-FRICTION_MAX, FRICTION_MAX), (0.0, elastica.q_max), (nearest, 1.0))
    found, exact, rates = elastica, None, Rates(np.empty(0))
    # Drags, positions and loads, until it is accurate.
    for size in ((3, 4, 5), (3, 7, 6), (4, 12, 7)):
        drags, loads, positions = (nodes(n, *end) for n, end in zip(size, ends, strict=True))
        at = positions, loads, drags
        solved = (solver if exact is None else uncut).laws_and_rates(*at)
        if exact is None:  # the derivatives are smooth enough for the fewest nodes
            rates, exact = Rates(solved[1:]), uncut.laws(*elastica.probes)
        added = solved[0] - laws(profile, *at, at_surface=True)
        found = replace(elastica, laws=elastica.laws + _spread(added, elastica))
        found = found.checked(exact)
        if found.error <= 4e-4:  # Relative to displacement and rotation
            break
    return found, rates


def _spread(added: Floats, base: Samples) -> Floats:
    """Return changes of the laws at the nodes of a table.

    Args:
        added: The changes at Chebyshev's nodes, shape (3, drags, loads, positions).
    """
    *others, places = base.nodes
    ends = ((-FRICTION_MAX, FRICTION_MAX), (0.0, base.q_max), (base.nearest, 1.0))
    added = added.copy()
    loads = nodes(added.shape[2], *ends[1])
    added[0] /= loads[:, None]  # without load there is no shortening
    targets = (*others, places.ravel())
    matrices = (
        through(count, target, *end)
        for count, target, end in zip(added.shape[1:], targets, ends, strict=True)
    )
    spread = np.einsum("lgnk,dg,qn,pk->ldqp", added, *matrices, optimize=True)
    spread[0] *= others[1][:, None]
    return spread.reshape(base.laws.shape)
