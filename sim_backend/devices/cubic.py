"""The reference between two samples of a controller: a cubic for each axis."""

from collections.abc import Iterable

import numpy as np

from sautereau.trajectory.motion import Floats

Cubic = tuple[float, float, float, float]
"""Coefficients of a0 + a1 f + a2 f^2 + a3 f^3 [counts], where f is the fraction of a sample."""


def along(cubics: Iterable[Cubic], fractions: Floats) -> tuple[Floats, Floats]:
    """Return positions and velocities of two axes within a sample.

    Args:
        cubics: Of both axes.
        fractions (array): shape (k,), of the sample, 0 to 1; also extrapolated beyond 1.

    Returns:
        Positions [counts] and velocities [counts per sample], shapes (k, 2).
    """
    # In plain floats: numpy takes four times as long for the few fractions of a sample.
    (a0, a1, a2, a3), (b0, b1, b2, b3) = cubics
    positions, velocities = [], []
    for f in fractions.tolist():
        positions.append((a0 + f * (a1 + f * (a2 + f * a3)), b0 + f * (b1 + f * (b2 + f * b3))))
        velocities.append((a1 + f * (2 * a2 + 3 * f * a3), b1 + f * (2 * b2 + 3 * f * b3)))
    return np.array(positions), np.array(velocities)
