"""Compensation of a sensor's delay, to a fraction of a sample."""

from functools import cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

HALF_WIDTH = 16
"""Samples on either side used to interpolate a value; fewer at the ends of the record."""
WIDTH = 2 * HALF_WIDTH
"""Samples used to interpolate a value."""
INTEGER_TOLERANCE = 1e-9
"""Samples by which a delay may differ from an integer number of them and count as one."""

Signal = NDArray[np.float64]


def undelayed(signal: Signal, lag: float) -> Signal:
    """Return a signal with its delay compensated, without extrapolation.

    Values between samples are those of Lagrange's polynomial through `HALF_WIDTH` samples on
    either side: a sine is reproduced to 1e-8 of its amplitude up to 0.2 of the sampling rate, to
    2e-4 at 0.3 and to 5 % at 0.4 (for the worst delay, half a sample). Near the ends the
    polynomial uses equally many samples on both sides, at least one. A NaN affects the values
    within 2 `WIDTH`.

    Args:
        signal: Shape (n,), in any unit.
        lag: Delay in samples, integer or not, not negative.

    Returns:
        Shape (n - lag rounded up,) or empty; sample k is the signal at k + lag.
    """
    integer, part = divmod(lag, 1.0)
    first = int(integer)
    if part > 1 - INTEGER_TOLERANCE:
        first, part = first + 1, 0.0
    if part < INTEGER_TOLERANCE:
        return signal[first:].copy()
    rows = max(0, len(signal) - first - 1)
    # Row k starts HALF_WIDTH - 1 samples before the sample that precedes value k WIDTH.
    blocks = np.zeros((-(-rows // WIDTH) + 1, WIDTH))
    flat, missing = blocks.reshape(-1), max(0, HALF_WIDTH - 1 - first)
    taps = signal[max(0, first - HALF_WIDTH + 1) :]
    flat[missing : missing + len(taps)] = taps
    near, far = _products(part)
    with np.errstate(over="ignore", invalid="ignore"):  # samples may be any double
        products = blocks[:-1] @ near
        products += blocks[1:] @ far
        found = products.reshape(-1)[:rows]
        # At the ends the complete stencil does not fit into the record.
        start = min(missing, rows)
        ends = np.r_[0:start, max(start, rows + 1 - HALF_WIDTH) : rows]
        halves = np.minimum(first + 1 + ends, rows - ends)
        windows = sliding_window_view(flat, WIDTH)[ends]
        found[ends] = (windows * _shortened(part)[halves]).sum(1)
    return found


@cache
def _products(part: float) -> tuple[Signal, Signal]:
    """Return the matrices that give a row of values: for its own samples, for the next row's.

    Matrix products are several times as fast as a correlation.
    """
    weights, index = _lagrange(part, HALF_WIDTH), np.arange(WIDTH)
    shift = index[:, None] - index
    return np.where(shift >= 0, weights[shift], 0.0), np.where(shift < 0, weights[shift], 0.0)


@cache
def _shortened(part: float) -> Signal:
    """Return weights of `WIDTH` samples; row k uses only k of them on either side."""
    weights = np.zeros((HALF_WIDTH, WIDTH))
    for half in range(1, HALF_WIDTH):
        weights[half, HALF_WIDTH - half : HALF_WIDTH + half] = _lagrange(part, half)
    return weights


def _lagrange(part: float, half: int) -> Signal:
    """Return the weights of samples 1 - half to half for the value at ``part``."""
    nodes = np.arange(1 - half, half + 1)
    weights = np.ones(2 * half)
    for i, node in enumerate(nodes):
        others = np.delete(nodes, i)
        weights[i] = np.prod((part - others) / (node - others))
    return weights
