"""The map of one shape of plectrum: displacement and rotation as Chebyshev series."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sautereau.analysis.model.plectrum.base import Floats

LOAD_LIMIT = 2.0
"""1, largest load f = F L^2 / EI that is answered for, EI being what the plectrum's rotation
under a small load at its tip gives; a uniform one turns by 56 degrees there."""
STRAIN_LIMIT = 0.2
"""1, of the edges at the clamp: thick plectra are answered for to so much strain only."""
MARGIN = 1.02
"""1, of that limit, to which loads are tabulated, for differences taken across it."""


@dataclass(frozen=True)
class Table:
    """Series in s and f of x, z and rotation, in lengths and rad, each divided by f."""

    coefficients: Floats
    """1, shape (3, positions, loads)."""
    nearest: float
    """1, least s [lengths]."""
    load: float
    """E W L, force at f = 1."""
    limit: float
    """1, largest f."""

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
