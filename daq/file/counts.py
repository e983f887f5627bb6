"""Counts of a converter and their polynomials."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Samples = NDArray[np.float64] | NDArray[np.int16] | NDArray[np.int32]
"""Volts, or the counts of a converter."""
TYPES = {"int16": "<i2", "int32": "<i4", "float64": "<f8"}
"""Type on the wire of each type of samples."""
_PIECE = 16384  # samples converted at a time, which the cache of a processor holds


@dataclass(frozen=True)
class Scaling:
    """Type of a device's counts, and the polynomials that convert them to volts."""

    kind: str
    """Type of a count: `int16` or `int32`."""
    coefficients: NDArray[np.float64]
    """Shape (n_channels, n_coefficients), V per count to the power of 0, 1, 2 ..."""


def write_volts(
    samples: Samples,
    scaling: Sequence[Sequence[float]],
    into: NDArray[np.float64] | NDArray[np.float32],
) -> None:
    """Write the volts of samples.

    Those of counts x are c0 + x (c1 + x (c2 + ...)), evaluated in this order in doubles.

    Args:
        samples: Shape (n_channels, n).
        scaling: c0, c1, ... of each channel, V per count to the power of 0, 1, ...; none for volts.
        into: Volts, shape (n_channels, n), V.
    """
    if not scaling:
        into[:] = samples
    for row, (*lower, highest) in enumerate(scaling):
        for at in range(0, samples.shape[1], _PIECE):
            x, volts = samples[row, at : at + _PIECE], into[row, at : at + _PIECE]
            if len(lower) == 1:  # four times as fast as the general way
                volts[:] = x
                volts *= highest
            else:
                volts[:] = highest
                for coefficient in lower[:0:-1]:
                    volts *= x
                    volts += coefficient
                if lower:
                    volts *= x
            if lower and lower[0]:
                volts += lower[0]
