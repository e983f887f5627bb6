"""The level `fe` of the plectrum: any outline by finite elements, from a stored table."""

from functools import lru_cache

import numpy as np

from sautereau.analysis.model.plectrum.cantilever import FRICTION_MAX
from sautereau.analysis.model.plectrum.elastica import Elastica, nearest_of
from sautereau.analysis.model.plectrum.fe.cache import stored
from sautereau.analysis.model.plectrum.fe.solve import Elastic
from sautereau.analysis.model.plectrum.profile import Profile
from sautereau.analysis.model.plectrum.table import Table
from sautereau.rig.instrument import Plectrum


def elastic_of(plectrum: Plectrum) -> Elastic:
    """Return the material of a plectrum, whose age leaves the ratios of the moduli."""
    along, shear = plectrum.youngs_modulus, plectrum.shear_modulus
    across = (plectrum.transverse_modulus or along) / along
    return Elastic(plectrum.poisson_ratio, across, shear and shear / along)


class FE(Elastica):
    """A plectrum of any outline, plane stress, with large rotations.

    The angle is the mean rotation of the section plus the slope of the unloaded upper edge. The
    load is normal to the deformed upper edge; friction acts there too, and bends the plectrum
    slightly more than on the mid-line.
    """

    represents = (*Elastica.represents, "transverse_modulus", "shear_modulus")

    def _table_of(self, plectrum: Plectrum, profile: Profile) -> Table:
        """Read the table from the cache, or build it.

        Raises:
            ModelError: The overlap is out of range, or the elements find no equilibrium.
        """
        return _table(profile, elastic_of(plectrum), nearest_of(plectrum))


@lru_cache(maxsize=32)
def _table(profile: Profile, material: Elastic, nearest: float) -> Table:
    def make():
        # Imported here because it imports scikit-fem, which a stored table does not need.
        from sautereau.analysis.model.plectrum.fe.build import build

        return build(profile, material, nearest)

    ratios = [material.poisson_ratio, FRICTION_MAX, nearest]
    if material[1:] != Elastic(0.0)[1:]:
        ratios += [material.across, material.shear or 0.0]
    ratios = np.array(ratios)
    return stored([profile.x, profile.top, profile.bottom, ratios], make).table()
