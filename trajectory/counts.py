"""Conversion between joint angles and encoder counts."""

import math

import numpy as np
from numpy.typing import ArrayLike

from sautereau.trajectory.motion import Floats
from sautereau.trajectory.segments import Counts


def to_counts(angles: ArrayLike, counts_per_revolution: int) -> Counts:
    """Round angles to encoder counts.

    Args:
        angles: rad, any shape.
        counts_per_revolution: Encoder counts per turn.

    Returns:
        Counts, of the same shape; half a count rounds to the even one.
    """
    turns = np.asarray(angles, dtype=np.float64) / (2 * math.pi)
    return np.rint(turns * counts_per_revolution).astype(np.int64)


def to_angles(counts: ArrayLike, counts_per_revolution: int) -> Floats:
    """Return the angles of encoder counts [rad], of the same shape."""
    return np.asarray(counts, dtype=np.float64) * (2 * math.pi / counts_per_revolution)
