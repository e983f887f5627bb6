"""A slow copy of a fast signal: means over whole groups, for viewers that draw scalars."""

import math

import numpy as np
from numpy.typing import NDArray

PREVIEW_RATE = 1000.0
"""Hz, that a preview does not exceed."""


class Decimator:
    """Average one channel over groups of samples; a group may span several blocks."""

    def __init__(self, rate: float):
        """Take a signal of ``rate`` Hz."""
        self.factor = math.ceil(rate / PREVIEW_RATE)
        """Samples in a group."""
        self._rest = np.empty(0)
        self._groups = 0

    def feed(self, values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Take the next samples and return the groups that they complete.

        Args:
            values: Shape (n_samples,), in any unit.

        Returns:
            Where the middle of each group lies, in samples from the first one of all, and
            the means in the unit of ``values``; both of shape (n_groups,).
        """
        held = np.concatenate([self._rest, values])
        n = len(held) // self.factor
        whole, self._rest = held[: n * self.factor], held[n * self.factor :]
        # A sensor may give inf or nan, and their mean is nan: no fault of the arithmetic.
        with np.errstate(invalid="ignore", over="ignore"):
            means = whole.reshape(n, self.factor).mean(axis=1)
        groups = np.arange(self._groups, self._groups + n, dtype=np.float64)
        middles = groups * self.factor + (self.factor - 1) / 2
        self._groups += n
        return middles, means
