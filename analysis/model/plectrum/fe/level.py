"""The level `fe` of the plectrum: any outline by finite elements, from a stored map."""

import numpy as np
from numpy.typing import ArrayLike

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Bend, Floats
from sautereau.analysis.model.plectrum.cantilever import FRICTION_MAX
from sautereau.analysis.model.plectrum.fe.cache import MARGIN, DisplacementSeries, stored
from sautereau.analysis.model.plectrum.fe.profile import profile_of
from sautereau.rig.instrument import Plectrum

REACHES = ((0.1, 0.85), (0.2, 0.7), (0.4, 0.5), (0.7, 0.2))
"""Fractions of the length: largest overlap, and the smallest s that is then tabulated."""
_PAST_TIP = 1.01


class FE:
    """A plectrum of any outline, plane stress, with large rotations.

    The contact point is that of the upper edge at s, lowered along the section by half the
    thickness at the clamp: for a uniform plectrum this is the mid-line, as at the other levels.
    x and z are counted from the same point of the clamp. The angle is the mean rotation of the
    section plus the slope of the unloaded upper edge. The load is normal to the deformed upper
    edge; friction acts there too, and bends the plectrum slightly more than on the mid-line.
    """

    represents = ("outline", "tip_thickness")

    def __init__(self, plectrum: Plectrum):
        """Read the plectrum's map from the cache, or build it (3 s).

        Raises:
            ModelError: The outline or the overlap is out of range, or the elements find no
                equilibrium.
        """
        self.length = plectrum.length
        self.friction = plectrum.friction
        self.profile = profile_of(plectrum)
        self.clamp_thickness = self.profile.clamp_thickness * self.length
        """m, of which the contact point lies half below the upper edge."""
        self._table = _table_of(plectrum)
        self.nearest = self._table.nearest * self.length
        """m, smallest position of the map."""
        self._load = self._table.load * plectrum.youngs_modulus * plectrum.width * self.length

    def bend(self, s: ArrayLike, force: ArrayLike, drag: ArrayLike | None = None) -> Bend:
        """Return the contact point for positions s [m] and forces F [N]; see `PlectrumMap`.

        Raises:
            ModelError: A position or a force is outside the map.
        """
        along = self.friction if drag is None else drag
        s, force, pulled = np.broadcast_arrays(*(np.asarray(a, float) for a in (s, force, along)))
        places = s / self.length
        height, slope, curvature = self.profile.contact_line(places)
        tilt, tilt_s = np.arctan(slope), curvature / (1 + slope**2)
        # Of the load on a sloping top, the parts along the normal and the tangent of the section.
        share = np.cos(tilt) - pulled * np.sin(tilt)
        loads, drags = force * share / self._load, np.tan(tilt + np.arctan(pulled))
        self._refuse_outside(places, loads)
        fields, along, across, pulls = self._table.values(places, loads, drags)
        along = along + pulls * (1 + drags**2) * tilt_s
        # f times its series, by the load and by the place: the slope turns f and T.
        by_load = fields + loads * across
        x_s, z_s, turned_s = loads * (along - by_load * drags * tilt_s)
        (x, z, turned), (x_f, z_f, turned_f) = loads * fields, by_load * share / self._load
        return Bend(
            self.length * (places + x),
            self.length * (height + z),
            tilt + turned,
            1 + x_s,
            slope + z_s,
            (tilt_s + turned_s) / self.length,
            x_f * self.length,
            z_f * self.length,
            turned_f,
        )

    def slope(self, s: ArrayLike) -> tuple[Floats, Floats]:
        """Return the slope [rad] of the unloaded top at positions s [m], and d(slope)/ds."""
        _, slope, curvature = self.profile.contact_line(np.asarray(s, float) / self.length)
        return np.arctan(slope), curvature / (1 + slope**2) / self.length

    def force_limit(self, s: ArrayLike) -> Floats:
        """Return the largest force [N] of the map at positions s [m], whatever the drag."""
        slope, _ = self.slope(s)
        share = np.cos(slope) + self.friction * abs(np.sin(slope))
        return np.asarray(self._table.limit * self._load / share, float)

    def _refuse_outside(self, places: Floats, loads: Floats) -> None:
        for what, unit, scale, values, low, high in (
            ("position", "mm", 1e3 * self.length, places, self._table.nearest, _PAST_TIP),
            ("force", "N", self._load, loads, 0.0, self._table.limit * MARGIN),
        ):
            outside = values[~((values >= low) & (values <= high))]
            if outside.size:
                raise ModelError(
                    f"plectrum: a {what} of {scale * outside.flat[0]:.4g} {unit} is outside its"
                    f" map, {scale * low:.4g} to {scale * high:.4g} {unit}; stay inside, or use"
                    " the level elastica"
                )


def _table_of(plectrum: Plectrum) -> DisplacementSeries:
    """Return the map of a plectrum's shape."""
    profile = profile_of(plectrum)
    share = plectrum.overlap / plectrum.length
    nearest = next((near for most, near in REACHES if share <= most), None)
    if nearest is None:
        raise ModelError(
            f"plectrum.overlap: {plectrum.overlap * 1e3:.4g} mm is more than"
            f" {100 * REACHES[-1][0]:.0f} % of the plectrum's {plectrum.length * 1e3:.4g} mm, and"
            " what remains is no beam; lower overlap"
        )
    ratios = np.array([plectrum.poisson_ratio, FRICTION_MAX, nearest])

    def make() -> DisplacementSeries:
        # Imported here because it imports scikit-fem, which a stored map does not need.
        from sautereau.analysis.model.plectrum.fe.build import build

        return build(profile, plectrum.poisson_ratio, nearest)

    return stored([profile.x, profile.top, profile.bottom, ratios], make)
