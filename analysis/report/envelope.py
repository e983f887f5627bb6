"""A signal drawn with few points that still shows its every peak."""

from itertools import pairwise

import numpy as np

from sautereau.trajectory.motion import Floats


def envelope(signal: Floats, points: int) -> np.ndarray:
    """Return which samples to draw: the least and the largest of even stretches, in order.

    A line through them covers what a line through all samples would cover, at the width of
    a stretch; no sample is averaged or moved.

    Args:
        signal: Shape (n,), without NaN.
        points: About so many are kept; the first and the last always are.

    Returns:
        Indices, rising; shape (m,). All of them where there are no more than ``points``.
    """
    n = len(signal)
    if n <= max(points, 2):
        return np.arange(n)
    edges = np.linspace(0, n, max(1, points // 2) + 1).astype(int)
    extremes = [
        start + place
        for start, stop in pairwise(edges)
        for place in (signal[start:stop].argmin(), signal[start:stop].argmax())
    ]
    return np.unique([0, *extremes, n - 1])
