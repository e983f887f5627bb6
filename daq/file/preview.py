"""A slow copy of fast signals, free of aliases, for viewers that draw scalars."""

import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

PREVIEW_RATE = 1000.0
"""Hz, that a preview does not exceed."""
ATTENUATION = 60.0
"""dB, from half the preview's rate up, which nothing can be folded from."""
PASS_BAND = 0.2
"""1, share of the preview's rate up to which a preview is true to 0.2 %."""
BATCH = 200
"""Values of a preview that are made at a time."""

Signals = NDArray[np.float64]


def low_pass(factor: int) -> NDArray[np.float64]:
    """Return the weights of the filter before a decimation: symmetric, of sum 1.

    A sinc in Kaiser's window (Oppenheim and Schafer, Discrete-Time Signal Processing,
    7.6): its length follows from the attenuation and the width of the transition, from
    `PASS_BAND` to half the preview's rate.

    Args:
        factor: Samples to a sample of the preview.
    """
    if factor == 1:
        return np.ones(1)
    width = 2 * math.pi * (0.5 - PASS_BAND) / factor
    attenuation = ATTENUATION + 2  # the formulas fall short of what they are given by 1 dB
    half = math.ceil((attenuation - 8) / (2.285 * width) / 2)
    cutoff = (0.5 + PASS_BAND) / 2 / factor
    beta = 0.1102 * (attenuation - 8.7)
    n = np.arange(-half, half + 1)
    weights = np.sinc(2 * cutoff * n) * np.kaiser(len(n), beta)
    return weights / weights.sum()


class Decimator:
    """Filter and thin out signals given in blocks, however they are cut."""

    def __init__(self, rate: float, n_channels: int):
        """Take ``n_channels`` signals of ``rate`` Hz."""
        self.factor = math.ceil(rate / PREVIEW_RATE)
        """Samples to a sample of the preview."""
        self._weights = low_pass(self.factor)
        self._blocks = [np.empty((n_channels, 0))]
        self._n_held = 0
        self._first = 0

    @property
    def margin(self) -> int:
        """Samples at either end that no preview stands for: half the filter."""
        return len(self._weights) // 2

    def feed(self, values: Signals) -> tuple[Signals, Signals]:
        """Take the next samples and return what they complete, `BATCH` values at the least.

        Args:
            values: Shape (n_channels, n_samples), in any unit.

        Returns:
            Where each value of the preview lies, shape (n,), in samples from the first one
            of all; and the values, shape (n_channels, n), in the unit of ``values``. The
            filter delays nothing. Mostly none, for they come in batches.
        """
        self._blocks.append(values)
        self._n_held += values.shape[1]
        if self._n_complete() < BATCH:
            return np.empty(0), np.empty((len(values), 0))
        return self.rest()

    def rest(self) -> tuple[Signals, Signals]:
        """Return what is complete, as `feed`, however little it is."""
        held = np.concatenate(self._blocks, axis=1)
        n = self._n_complete()
        places = self._first + self.margin + self.factor * np.arange(n, dtype=np.float64)
        self._first += n * self.factor
        self._blocks = [held[:, n * self.factor :].copy()]
        self._n_held = self._blocks[0].shape[1]
        if not n:
            return places, np.empty((len(held), 0))
        windows = sliding_window_view(held, len(self._weights), axis=1)[:, :: self.factor]
        # A sensor may give inf or nan, and what it makes is nan: no fault of the arithmetic.
        with np.errstate(invalid="ignore", over="ignore"):
            return places, windows @ self._weights

    def _n_complete(self) -> int:
        return max(0, (self._n_held - len(self._weights)) // self.factor + 1)
