"""A quantity over time with its first two derivatives."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Motion(NamedTuple):
    """Position, velocity and acceleration on one time base; each of shape (n,) or (n, 2)."""

    position: Floats
    velocity: Floats
    acceleration: Floats


def cross(a: Floats, b: Floats) -> Floats:
    """Return the y component of the plane's cross product, shape (n,), of arrays (n, 2)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def dot(a: Floats, b: Floats) -> Floats:
    """Return the scalar product over the last axis, shape (n,), of arrays (n, 2)."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1]
