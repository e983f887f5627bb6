"""Large rotation of a cantilever under a load that follows its deformed surface.

Seen from the loaded point of a uniform plectrum, the tangent's angle psi at an arc length
xi sqrt(EI / F) towards the clamp obeys the balance of moments psi'' = cos psi + T sin psi,
psi(0) = psi'(0) = 0: F is normal to the surface at psi = 0 and the drag T F, the friction of the
string, lies along it. (That is sqrt(1 + T^2) cos(psi - delta) with tan delta = T: one load,
inclined by delta.) With xi = s sqrt(F / EI) then theta = -psi(xi), and the contact point follows by
rotating the integrals of cos psi and sin psi by theta. psi is even in xi, so all of it is smooth in
the one number q = xi^2 = F s^2 / EI: for each T one table serves every s, F, E and section. It is
as smooth in T: one integration serves every drag.

Of any other outline the table depends on s too. In the range of a string's positions it is smooth,
but for the kinks of the outline.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Bend, Floats
from sautereau.analysis.model.plectrum.cantilever import FRICTION_MAX, Cantilever, similar
from sautereau.analysis.model.plectrum.profile import Profile, profile_of
from sautereau.analysis.model.plectrum.table import (
    Samples,
    Table,
    arranged,
    chebyshev,
    laws_of_terms,
    laws_under,
    nodes,
)
from sautereau.analysis.model.plectrum.tapered import tapered_table
from sautereau.rig.instrument import Plectrum

REACHES = ((0.1, 0.85), (0.2, 0.7), (0.4, 0.5), (0.7, 0.2))
"""Fractions of the length: largest overlap, and the smallest s that is then tabulated."""


class Elastica(Cantilever):
    """The plectrum without stretch and shear, of a uniform section or of any outline."""

    represents: tuple[str, ...] = ("outline", "tip_thickness")

    def __init__(self, plectrum: Plectrum):
        """Read and check the plectrum's parameters; compute the table of its shape.

        Raises:
            ModelError: Friction, stiffness, overlap or outline are out of range.
        """
        super().__init__(plectrum)
        profile = profile_of(plectrum)
        self.clamp_thickness = profile.clamp_thickness * self.length
        """m, of which the contact point lies half below the upper edge."""
        self.bending_stiffness *= (self.clamp_thickness / plectrum.thickness) ** 3
        self.table = self._table_of(plectrum, profile)
        self.nearest = self.table.nearest * self.length

    def _table_of(self, plectrum: Plectrum, profile: Profile) -> Table:
        """Return the table of the plectrum's shape."""
        if not plectrum.described:
            return uniform_table()
        return tapered_table(profile, nearest_of(plectrum))

    def slope(self, s: ArrayLike) -> tuple[Floats, Floats]:
        """Return the slope [rad] of the unloaded surface at positions s [m], and d(slope)/ds."""
        (_, slope), (_, slope_p) = self.table.contact_line(np.asarray(s, float) / self.length)
        return slope, slope_p / self.length

    def _bend(self, s: Floats, force: Floats, drag: Floats) -> Bend:
        q, place = force * s**2 / self.bending_stiffness, s / self.length
        if drag.size and np.all(drag == drag.flat[0]):
            found = [arranged(laws(q)) for laws in laws_under(self.table, float(drag.flat[0]))]
        else:
            basis = chebyshev(drag, len(self.table.cells) - 1)
            found = [
                arranged(np.einsum("...t,...tkpl->...kpl", basis, laws(q)))
                for laws in laws_of_terms(self.table)
            ]
        ((x, z, theta), slopes), ((dx, dz, dtheta), _) = (
            self.table.with_slopes(f, place) for f in found
        )
        shape = (x, q * z, q * theta, dx, z + q * dz, theta + q * dtheta)
        bend = similar(s, force, self.bending_stiffness, shape)
        if self.table.uniform:
            return bend
        (height, tilt), (height_p, tilt_p) = self.table.contact_line(place)
        return bend._replace(
            z=bend.z + height * self.length,
            theta=bend.theta + tilt,
            x_s=bend.x_s + place * slopes[0],
            z_s=bend.z_s + q * place * slopes[1] + height_p,
            theta_s=bend.theta_s + (q * slopes[2] + tilt_p) / self.length,
        )

    def _force_limit(self, s: Floats) -> Floats:
        return self.table.limit(self.friction) * self.bending_stiffness / s**2


def nearest_of(plectrum: Plectrum) -> float:
    """Return the smallest s [lengths] of the table of a plectrum of another shape.

    Raises:
        ModelError: The overlap is too large for a table.
    """
    share = plectrum.overlap / plectrum.length
    nearest = next((near for most, near in REACHES if share <= most), None)
    if nearest is None:
        raise ModelError(
            f"plectrum.overlap: {plectrum.overlap * 1e3:.4g} mm is more than"
            f" {100 * REACHES[-1][0]:.0f} % of the plectrum's {plectrum.length * 1e3:.4g} mm, and"
            " what remains is no beam; lower overlap"
        )
    return nearest


@lru_cache(maxsize=1)
def uniform_table() -> Table:
    """Return the table of every uniform section."""
    from scipy.integrate import solve_ivp

    q_max = 3.43  # The tangent has turned by `TURN`; by 90 degrees at 3.4376
    drag, q = nodes(13, -FRICTION_MAX, FRICTION_MAX), nodes(41, 0.0, q_max)

    def right(_, y):
        # psi, integral of cos psi, integral of sin psi; psi' is their load's lever.
        psi, cosines, sines = y.reshape(3, -1)
        return np.ravel([cosines + drag * sines, np.cos(psi), np.sin(psi)])

    at, start = np.sqrt(q), np.zeros(3 * len(drag))
    solution = solve_ivp(right, (0, at[-1]), start, "DOP853", t_eval=at, rtol=1e-13, atol=1e-16)
    psi, cosines, sines = solution.y.reshape(3, len(drag), len(q))
    x = (np.cos(psi) * cosines + np.sin(psi) * sines) / np.sqrt(q)
    z = (np.cos(psi) * sines - np.sin(psi) * cosines) / np.sqrt(q) / q
    laws = np.stack([x, z, -psi / q])[..., None, None]
    return Samples(laws, np.zeros((2, 1, 1)), 128, q_max).table()
