"""The residuals' own covariance, so that hum and filters do not pass for information.

Residuals half a millisecond apart hold together: by the smoothing, by mains hum, by what the
model does not know. Their autocovariance, taken from a fit that ignores it, whitens the next
fit (generalised least squares); instants that are left out are simply not in the covariance.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sautereau.trajectory.motion import Floats

REACH = 50e-3
"""s, over which residuals may hold together: two and a half periods of the mains."""
FLOOR = 1e-3
"""1, of the mean of the noise's spectrum, that no part of it falls below."""
QUIET = 1e-18
"""N^2, least variance of residuals, of presses without any noise."""


@dataclass(frozen=True)
class Whitening:
    """Turn residuals of one press into independent ones of variance 1, unknown trends taken off."""

    factor: Floats
    """N, lower Cholesky factor of the covariance, its diagonals as rows: shape (band, n)."""
    trends: Floats
    """1, whitened trends, orthonormal; shape (n, trends)."""
    shapes: Floats
    """N, the trends themselves, of the same coefficients; shape (n, trends)."""

    def __call__(self, residual: Floats) -> Floats:
        """Return whitened residuals [1] of residuals [N], shape (n,)."""
        white = _solved(self.factor, residual)
        return white - self.trends @ (self.trends.T @ white)

    def trend(self, residual: Floats) -> Floats:
        """Return the trend [N] in residuals [N], shape (n,)."""
        return self.shapes @ (self.trends.T @ _solved(self.factor, residual))


def whitening(used: NDArray[np.bool_], covariance: Floats, levelled: bool) -> Whitening:
    """Return the whitening of one press.

    Args:
        used: Which of its even instants are fitted.
        covariance: N^2, over lags from 0 in instants; 0 beyond.
        levelled: Whether the force has an unknown level and an unknown slow ramp, as AC coupling
            leaves them.
    """
    from scipy.linalg import cholesky_banded

    at = np.flatnonzero(used)
    band, count = min(len(covariance), len(at)), len(at)
    padded = np.append(covariance, 0.0)
    diagonals = np.zeros((band, count))
    for row in range(band):
        lags = at[row:] - at[: count - row]
        diagonals[row, : count - row] = padded[np.minimum(lags, len(covariance))]
    factor = cholesky_banded(diagonals, lower=True, check_finite=False)
    columns = [np.ones(count), 2 * (at - at[0]) / max(at[-1] - at[0], 1) - 1] if levelled else []
    plain = np.stack(columns, 1) if columns else np.zeros((count, 0))
    white = np.stack([_solved(factor, c) for c in columns], 1) if columns else plain
    trends, mixing = np.linalg.qr(white)
    return Whitening(factor, trends, plain @ np.linalg.inv(mixing))


def _solved(factor: Floats, values: Floats) -> Floats:
    """Return what a banded lower factor makes of values by forward substitution."""
    from scipy.linalg import get_lapack_funcs

    (tbtrs,) = get_lapack_funcs(("tbtrs",), (factor,))
    found, _ = tbtrs(factor, values[:, None], uplo="L")
    return np.asarray(found, float)[:, 0]


def autocovariance(
    residuals: Sequence[Floats], used: Sequence[NDArray[np.bool_]], step: float, spent: int
) -> Floats:
    """Return the residuals' autocovariance [N^2] over lags in instants, a positive one.

    Args:
        residuals: N, of each press at its used instants.
        used: Which of each press's even instants those are.
        step: s, between instants.
        spent: Parameters that the residuals were fitted with.
    """
    from scipy.signal.windows import parzen

    count = max(2, round(REACH / step))
    sums, pairs = np.zeros(count), np.zeros(count)
    for residual, which in zip(residuals, used, strict=True):
        values = np.zeros(len(which))
        values[which] = residual
        size = 2 * len(values)
        for held, series in ((sums, values), (pairs, which.astype(float))):
            spectrum = np.abs(np.fft.rfft(series, size)) ** 2
            lagged = np.fft.irfft(spectrum, size)[: min(count, len(values))]
            held[: len(lagged)] += lagged
    total = sum(len(r) for r in residuals)
    means = np.divide(sums, pairs, out=np.zeros(count), where=pairs > 0.5)
    means *= total / max(total - spent, 1) * parzen(2 * count - 1)[count - 1 :]
    # A sum over pairs that are not all there need not be a covariance: white noise mends it.
    spectrum = np.fft.hfft(means, 16 * count)
    least = FLOOR * float(spectrum.mean())
    means[0] = max(QUIET, float(means[0]) + max(0.0, least - float(spectrum.min())))
    return means
