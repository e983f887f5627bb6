"""Take back the lag of a sensor, to a fraction of a sample."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

HALF_WIDTH = 16
"""Samples on either side that make a value between two; fewer at the ends of the record."""
WHOLE = 1e-9
"""Samples by which a lag may miss a whole number of them and still be one."""

Signal = NDArray[np.float64]


def undelayed(signal: Signal, lag: float) -> Signal:
    """Return a signal as it would be without its lag, where there are samples to tell.

    Between samples a value is Lagrange's polynomial through the `HALF_WIDTH` on either side:
    a sine comes back to 1e-8 of its height up to a fifth of the rate, to 2e-4 at 0.3 of it,
    to 5 % at 0.4 (half a sample being the worst). Near the ends the polynomial is through as
    many as there are on both sides, down to the two beside it. Nothing is carried on beyond
    the samples.

    Args:
        signal: Shape (n,), in any unit.
        lag: Samples, whole or not, from 0 on.

    Returns:
        Shape (n - lag rounded up,) or empty; sample k is the signal at k + lag.
    """
    whole, part = divmod(lag, 1.0)
    first = int(whole)
    if part > 1 - WHOLE:
        first, part = first + 1, 0.0
    if part < WHOLE:
        return signal[first:].copy()
    rows = max(0, len(signal) - first - 1)
    found = np.empty(rows)
    # Those of which a whole stencil lies within the record come after some and before others.
    start = min(max(HALF_WIDTH - 1 - first, 0), rows)
    stop = max(start, rows + 1 - HALF_WIDTH)
    if stop > start:
        taps = signal[first + start - HALF_WIDTH + 1 : first + stop + HALF_WIDTH]
        found[start:stop] = np.correlate(taps, _lagrange(part, HALF_WIDTH), "valid")
    for k in (*range(start), *range(stop, rows)):
        half = min(HALF_WIDTH, first + k + 1, len(signal) - 1 - first - k)
        taps = signal[first + k - half + 1 : first + k + half + 1]
        found[k] = taps @ _lagrange(part, half)
    return found


@cache
def _lagrange(part: float, half: int) -> Signal:
    """Return the weights of samples 1 - half to half for the value at ``part``."""
    places = np.arange(1 - half, half + 1)
    weights = np.ones(2 * half)
    for i, place in enumerate(places):
        others = np.delete(places, i)
        weights[i] = np.prod((part - others) / (place - others))
    return weights
