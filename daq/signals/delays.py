"""Take back the lag of a sensor, to a fraction of a sample."""

from functools import cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

HALF_WIDTH = 16
"""Samples on either side that make a value between two; fewer at the ends of the record."""
WIDTH = 2 * HALF_WIDTH
"""Samples that make one."""
WHOLE = 1e-9
"""Samples by which a lag may miss a whole number of them and still be one."""

Signal = NDArray[np.float64]


def undelayed(signal: Signal, lag: float) -> Signal:
    """Return a signal as it would be without its lag, where there are samples to tell.

    Between samples a value is Lagrange's polynomial through the `HALF_WIDTH` on either side:
    a sine comes back to 1e-8 of its height up to a fifth of the rate, to 2e-4 at 0.3 of it,
    to 5 % at 0.4 (half a sample being the worst). Near the ends the polynomial is through as
    many as there are on both sides, down to the two beside it. Nothing is carried on beyond
    the samples. One that is not a number spoils those within 2 `WIDTH`.

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
    # Row k begins HALF_WIDTH - 1 samples before the one that comes before value k WIDTH.
    blocks = np.zeros((-(-rows // WIDTH) + 1, WIDTH))
    flat, missing = blocks.reshape(-1), max(0, HALF_WIDTH - 1 - first)
    taps = signal[max(0, first - HALF_WIDTH + 1) :]
    flat[missing : missing + len(taps)] = taps
    near, far = _products(part)
    with np.errstate(over="ignore", invalid="ignore"):  # samples may be anything
        products = blocks[:-1] @ near
        products += blocks[1:] @ far
        found = products.reshape(-1)[:rows]
        # Of the first and the last the whole stencil does not lie within the record.
        start = min(missing, rows)
        ends = np.r_[0:start, max(start, rows + 1 - HALF_WIDTH) : rows]
        halves = np.minimum(first + 1 + ends, rows - ends)
        windows = sliding_window_view(flat, WIDTH)[ends]
        found[ends] = (windows * _shortened(part)[halves]).sum(1)
    return found


@cache
def _products(part: float) -> tuple[Signal, Signal]:
    """Return what makes the values of a row: a matrix for its samples, one for the next row's.

    Products of matrices are several times as fast as a correlation.
    """
    weights, place = _lagrange(part, HALF_WIDTH), np.arange(WIDTH)
    shift = place[:, None] - place
    return np.where(shift >= 0, weights[shift], 0.0), np.where(shift < 0, weights[shift], 0.0)


@cache
def _shortened(part: float) -> Signal:
    """Return the weights of `WIDTH` samples, row by row, with so many on either side in use."""
    weights = np.zeros((HALF_WIDTH, WIDTH))
    for half in range(1, HALF_WIDTH):
        weights[half, HALF_WIDTH - half : HALF_WIDTH + half] = _lagrange(part, half)
    return weights


def _lagrange(part: float, half: int) -> Signal:
    """Return the weights of samples 1 - half to half for the value at ``part``."""
    places = np.arange(1 - half, half + 1)
    weights = np.ones(2 * half)
    for i, place in enumerate(places):
        others = np.delete(places, i)
        weights[i] = np.prod((part - others) / (place - others))
    return weights
