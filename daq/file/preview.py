"""Previews: signals decimated without aliasing, for viewers that plot scalars."""

import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

PREVIEW_RATE = 1000.0
"""Largest rate of a preview, Hz."""
ATTENUATION = 60.0
"""Stop-band attenuation, from half the preview's rate up, dB."""
PASS_BAND = 0.2
"""Dimensionless, fraction of the preview's rate up to which it is accurate to 0.2 %."""
BATCH = 200
"""Values of a preview computed at a time."""

Signals = NDArray[np.float64]


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
        self._weights = low_pass(self.factor)
        self._blocks = [np.empty((n_channels, 0))]
        self._n_held = 0
        self._first = 0

    @property
    def margin(self) -> int:
        """Samples at either end without a preview: half the filter's length."""
        return len(self._weights) // 2

    def feed(self, values: Signals) -> tuple[Signals, Signals]:
        """Add samples and return the new values of the preview, in batches of `BATCH` or more.

        Args:
            values: Shape (n_channels, n_samples), in any unit.

        Returns:
            Position of each value of the preview, in samples from the very first, shape (n,);
            and the values in the unit of ``values``, shape (n_channels, n). The filter has no
            delay. Both are empty until a batch is complete.
        """
        self._blocks.append(values)
        self._n_held += values.shape[1]
        if self._n_complete() < BATCH:
            return np.empty(0), np.empty((len(values), 0))
        return self.rest()

    def rest(self) -> tuple[Signals, Signals]:
        """Return the values that are complete, as `feed`, whatever their number."""
        held = np.concatenate(self._blocks, axis=1)
        n = self._n_complete()
        positions = self._first + self.margin + self.factor * np.arange(n, dtype=np.float64)
        self._first += n * self.factor
        self._blocks = [held[:, n * self.factor :].copy()]
        self._n_held = self._blocks[0].shape[1]
        if not n:
            return positions, np.empty((len(held), 0))
        windows = sliding_window_view(held, len(self._weights), axis=1)[:, :: self.factor]
        # Samples may be inf or NaN, which makes the preview NaN without a warning.
        with np.errstate(invalid="ignore", over="ignore"):
            return positions, windows @ self._weights

    def _n_complete(self) -> int:
        return max(0, (self._n_held - len(self._weights)) // self.factor + 1)
