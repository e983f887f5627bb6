"""Previews: signals decimated without aliasing, for viewers that plot scalars."""

import math
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from sautereau.daq.file.counts import Samples

PREVIEW_RATE = 1000.0
"""Largest rate of a preview, Hz."""
ATTENUATION = 60.0
"""Stop-band attenuation, from half the preview's rate up, dB."""
PASS_BAND = 0.2
"""Dimensionless, fraction of the preview's rate up to which it is accurate to 0.2 %."""

Signals = NDArray[np.float64]
Rows = tuple[NDArray[np.int64], Signals]
"""Places of the values of a preview, in samples from the very first, shape (n,); and the values,
shape (n_channels, n)."""


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
        self._columns = np.zeros((-(-len(weights) // self.factor), self.factor))
        self._columns.reshape(-1)[: len(weights)] = weights
        self._columns = self._columns.T.copy()
        self._length = len(weights)
        self._held = np.empty((n_channels, 0))
        self._first = 0

    def feed(self, values: Signals) -> Rows:
        """Add samples and return the new values of the preview.

        Args:
            values: Shape (n_channels, n_samples), in any unit.

        Returns:
            Places and values, in the unit of ``values``. The filter has no delay.
        """
        held = np.concatenate([self._held, values], axis=1)
        n = max(0, (held.shape[1] - self._length) // self.factor + 1)
        places = self._first + self.margin + self.factor * np.arange(n)
        self._first += n * self.factor
        self._held = held[:, n * self.factor :].copy()
        return places, self._filtered(held, n)

    def _filtered(self, held: Signals, n: int) -> Signals:
        """Return n values, each the sum of the products of as many rows as there are columns."""
        columns = self._columns.shape[1]
        rows = n + columns - 1 if n else 0
        missing = rows * self.factor - held.shape[1]
        if missing > 0:
            held = np.pad(held, ((0, 0), (0, missing)))
        grouped = held[:, : rows * self.factor].reshape(len(held), rows, self.factor)
        # Samples may be inf or NaN, which makes the preview NaN without a warning.
        with np.errstate(invalid="ignore", over="ignore"):
            products = np.ascontiguousarray(grouped @ self._columns)
            signal, row, column = products.strides
            diagonal = as_strided(products, (len(held), n, columns), (signal, row, row + column))
            return diagonal.sum(2)


class Previewer:
    """Makes the previews of a recording on a thread of its own."""

    def __init__(self, decimator: Decimator, to_si: Callable[[Samples], Signals]):
        """Start the thread.

        Args:
            decimator: New.
            to_si: Converts samples, shape (n_channels, n), to SI.
        """
        self._decimator, self._to_si = decimator, to_si
        self._thread = ThreadPoolExecutor(1, "preview")
        self._waiting: deque[tuple[int, Future[Rows]]] = deque()
        self._fed = self._made = 0
        self._rows: list[Rows] = []

    def feed(self, samples: Samples) -> None:
        """Add samples, shape (n_channels, n), which must not change any more."""
        self._fed += samples.shape[1]
        future = self._thread.submit(lambda: self._decimator.feed(self._to_si(samples)))
        self._waiting.append((self._fed - self._decimator.margin, future))

    def take(self, stop: int | None = None) -> Rows:
        """Return the next values up to a place, as far as the samples allow.

        Args:
            stop: Place after the last value; None for all.
        """
        while self._waiting and (stop is None or self._made < stop):
            self._made, future = self._waiting.popleft()
            self._rows.append(future.result())
        if not self._rows:
            return np.empty(0, np.int64), np.empty((0, 0))
        places = np.concatenate([places for places, _ in self._rows])
        values = np.concatenate([values for _, values in self._rows], axis=1)
        n = len(places) if stop is None else int(np.searchsorted(places, stop))
        self._rows = [(places[n:], values[:, n:])]
        return places[:n], values[:, :n]

    def close(self) -> None:
        """End the thread."""
        self._thread.shutdown(cancel_futures=True)
