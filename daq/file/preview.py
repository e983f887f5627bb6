"""Previews: signals decimated without aliasing, for viewers that plot scalars."""

import math

import numpy as np
from numpy.typing import NDArray

PREVIEW_RATE = 1000.0  # Largest rate of a preview, Hz
ATTENUATION = 60.0  # Stop-band attenuation, from half the preview's rate up, dB
PASS_BAND = 0.2  # Dimensionless, fraction of the preview's rate up to which it is accurate to 0.2 %

Values = NDArray[np.float32]
"""A preview has single precision, as in the file; this halves the time of the filter."""


def low_pass(factor: int) -> NDArray[np.float64]:
    """Return the weights of the anti-aliasing filter: symmetric, of sum 1.

    A sinc with a Kaiser window (Oppenheim and Schafer, Discrete-Time Signal Processing,
    7.6): its length follows from the attenuation and the transition band, from `PASS_BAND` to
    half the preview's rate.

    Args:
        factor: Decimation factor: samples per sample of the preview.
    """
    if factor == 1:
        return np.ones(1)
    width = 2 * math.pi * (0.5 - PASS_BAND) / factor
    attenuation = ATTENUATION + 2  # the formulas reach 1 dB less than they are given
    half = math.ceil((attenuation - 8) / (2.285 * width) / 2)
    cutoff = (0.5 + PASS_BAND) / 2 / factor
    beta = 0.1102 * (attenuation - 8.7)
    n = np.arange(-half, half + 1)
    weights = np.sinc(2 * cutoff * n) * np.kaiser(len(n), beta)
    return weights / weights.sum()


class Decimator:
    """Low-pass filter and decimate signals given in blocks of any length."""

    def __init__(self, rate: float, n_channels: int):
        """Start with ``n_channels`` signals sampled at ``rate`` Hz."""
        self.factor = math.ceil(rate / PREVIEW_RATE)
        """Samples per sample of the preview."""
        weights = low_pass(self.factor)
        self.margin = len(weights) // 2
        """Samples at either end without a preview: half the filter's length."""
        # One column for each stretch of `factor` weights; the last one ends with zeros.
        self._columns = np.zeros((-(-len(weights) // self.factor), self.factor), np.float32)
        self._columns.reshape(-1)[: len(weights)] = weights
        self._columns = self._columns.T.copy()
        self._length = len(weights)
        self._held = np.empty((n_channels, 0), np.float32)
        self._fill = 0
        self.place = self.margin
        """Index of the sample at the next value of the preview, counted from the very first."""

    def room(self, n: int) -> Values:
        """Return a buffer for the next ``n`` samples, shape (n_channels, n), to be filled."""
        start, self._fill = self._fill, self._fill + n
        if self._fill > self._held.shape[1]:
            held = self._held[:, :start]
            self._held = np.empty((len(held), self._fill + self._length), np.float32)
            self._held[:, :start] = held
        return self._held[:, start : self._fill]

    def feed(self, values: NDArray[np.float64]) -> tuple[NDArray[np.int64], Values]:
        """Add samples, shape (n_channels, n), in any unit; return places and values as `rest`."""
        first = self.place
        self.room(values.shape[1])[:] = values
        found = self.rest()
        return np.arange(first, self.place, self.factor), found

    def rest(self) -> Values:
        """Return the new values of the preview, shape (n_channels, n), in the unit of the samples.

        The filter has no delay.
        """
        n, fill = max(0, (self._fill - self._length) // self.factor + 1), self._fill
        values = self._filtered(n)
        used = n * self.factor
        self._held[:, : fill - used] = self._held[:, used:fill].copy()
        self.place, self._fill = self.place + used, fill - used
        return values

    def _filtered(self, n: int) -> Values:
        """Return ``n`` values; each sums the products of consecutive rows and columns."""
        columns = self._columns.shape[1]
        rows = n + columns - 1 if n else 0
        # The weights that the last row has beyond the samples are zero.
        self.room(max(0, rows * self.factor - self._fill))[:] = 0
        grouped = self._held[:, : rows * self.factor].reshape(len(self._held), rows, self.factor)
        # Samples may be inf or NaN, which makes the preview NaN without a warning.
        with np.errstate(invalid="ignore", over="ignore"):
            products = np.ascontiguousarray(grouped @ self._columns)
            signal, row, column = products.strides
            shape, strides = (len(products), n, columns), (signal, row, row + column)
            return np.ndarray(shape, np.float32, products, 0, strides).sum(2)
