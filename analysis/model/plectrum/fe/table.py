"""The map of one shape of plectrum: displacement and rotation as Chebyshev series."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sautereau.analysis.model.plectrum.base import Floats

LOAD_LIMIT = 2.0
"""Largest load f = F L^2 / EI of a map, dimensionless; EI follows from the plectrum's rotation
under a small load at its tip. A uniform plectrum turns by 56 degrees at this load."""
STRAIN_LIMIT = 0.2
"""Largest strain of the edges at the clamp, which limits the load of thick plectra."""
MARGIN = 1.02
"""Ratio of the tabulated to the accepted load, for differences taken across the limit."""


@dataclass(frozen=True)
class DisplacementSeries:
    """Series in s and f of x, z and rotation, in lengths and rad, each divided by f."""

    coefficients: Floats
    """Dimensionless, shape (3, positions, loads)."""
    nearest: float
    """Smallest s, in lengths."""
    load: float
    """Force at f = 1, in E W L."""
    limit: float
    """Largest f, dimensionless."""

    def values(self, s: Floats, f: Floats) -> Floats:
        """Return the series, their slopes along s and along f, shape (3, 3, *s.shape)."""
        chebyshev = np.polynomial.chebyshev
        positions, loads = self.coefficients.shape[1:]
        along = chebyshev.chebvander(2 * (s - self.nearest) / (1 - self.nearest) - 1, positions - 1)
        across = chebyshev.chebvander(2 * f / (self.limit * MARGIN) - 1, loads - 1)
        along, across = (basis.reshape(*s.shape, basis.shape[-1]) for basis in (along, across))
        half = np.tensordot(along, self._series, (-1, 2))
        return np.moveaxis((half @ across[..., None, :, None])[..., 0], (-2, -1), (0, 1))

    @cached_property
    def _series(self) -> Floats:
        """The series, their slopes along s and along f, shape (3, 3, positions, loads)."""
        series = np.zeros((3, *self.coefficients.shape))
        series[0] = self.coefficients
        for axis, reach in ((1, 1 - self.nearest), (2, self.limit * MARGIN)):
            slope = np.polynomial.chebyshev.chebder(self.coefficients, scl=2 / reach, axis=axis)
            series[axis][:, : slope.shape[1], : slope.shape[2]] = slope
        return series
