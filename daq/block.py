"""Consecutive samples, as they go from the acquisition to the recording."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Block:
    """Consecutive samples of all channels."""

    first_sample: int
    """Index of the first sample, counted from the trigger."""
    volts: NDArray[np.float64]
    """Shape (n_channels, n), V, channels in the order of ``daq.channels``."""
