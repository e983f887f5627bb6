"""The level `fe` of the plectrum: any outline by finite elements, from a stored table."""

from functools import lru_cache

import numpy as np

from sautereau.analysis.model.plectrum.cantilever import FRICTION_MAX
from sautereau.analysis.model.plectrum.elastica import Elastica, nearest_of
from sautereau.analysis.model.plectrum.fe.cache import stored
from sautereau.analysis.model.plectrum.profile import Profile
from sautereau.analysis.model.plectrum.table import Table
from sautereau.rig.instrument import Plectrum


class FE(Elastica):
    """A plectrum of any outline, plane stress, with large rotations.

    The angle is the mean rotation of the section plus the slope of the unloaded upper edge. The
    load is normal to the deformed upper edge; friction acts there too, and bends the plectrum
    slightly more than on the mid-line.
    """

    def _table_of(self, plectrum: Plectrum, profile: Profile) -> Table:
        """Read the table from the cache, or build it.

        Raises:
            ModelError: The overlap is out of range, or the elements find no equilibrium.
        """
        return _table(profile, plectrum.poisson_ratio, nearest_of(plectrum))


@lru_cache(maxsize=32)
def _table(profile: Profile, poisson_ratio: float, nearest: float) -> Table:
    def make():
        # Imported here because it imports scikit-fem, which a stored table does not need.
        from sautereau.analysis.model.plectrum.fe.build import build

        return build(profile, poisson_ratio, nearest)

    ratios = np.array([poisson_ratio, FRICTION_MAX, nearest])
    return stored([profile.x, profile.top, profile.bottom, ratios], make).table()
