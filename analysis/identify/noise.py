"""The covariance of the residuals, for generalised least squares.

Residuals half a millisecond apart are correlated: by the smoothing, by mains hum, by errors of
the model. Their autocovariance, estimated from a fit that ignores it, whitens the next fit.
Excluded instants are not in the covariance.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sautereau.trajectory.motion import Floats

REACH = 50e-3
"""s, longest lag of the autocovariance: two and a half periods of the mains."""
FLOOR = 1e-3
"""Dimensionless, smallest value of the noise spectrum over its mean."""
QUIET = 1e-18
"""N^2, smallest variance of residuals, for presses without noise."""


@dataclass(frozen=True)
class Whitening:
    """Maps residuals of one press to independent ones of variance 1, without unknown trends."""

    factor: Floats
    """N, lower Cholesky factor of the covariance, banded, diagonals as rows: shape (band, n)."""
    trends: Floats
    """Whitened trends, orthonormal; shape (n, trends)."""
    shapes: Floats
    """N, the same trends before whitening; shape (n, trends)."""

    def __call__(self, residual: Floats) -> Floats:
        """Return the whitened residuals [1] of residuals [N], shape (n,)."""
        white = _solved(self.factor, residual)
        return white - self.trends @ (self.trends.T @ white)

    def trend(self, residual: Floats) -> Floats:
        """Return the trend [N] in residuals [N], shape (n,)."""
        return self.shapes @ (self.trends.T @ _solved(self.factor, residual))


def whitening(used: NDArray[np.bool_], covariance: Floats, levelled: bool) -> Whitening:
    """Return the whitening of one press.

    Args:
        used: Which of its equidistant instants are fitted.
        covariance: N^2, over the lag in instants, from 0; longer lags have covariance 0.
        levelled: Whether the force has an unknown level and an unknown slow ramp, because of AC
            coupling.
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
    """Return the solution for a banded lower factor by forward substitution."""
    from scipy.linalg import get_lapack_funcs

    (tbtrs,) = get_lapack_funcs(("tbtrs",), (factor,))
    found, _ = tbtrs(factor, values[:, None], uplo="L")
    return np.asarray(found, float)[:, 0]


def autocovariance(
    residuals: Sequence[Floats], used: Sequence[NDArray[np.bool_]], step: float, spent: int
) -> Floats:
    """Return a positive definite autocovariance [N^2] of the residuals over the lag in instants.

    Args:
        residuals: N, of each press at its used instants.
        used: Which of the equidistant instants of each press those are.
        step: s, between instants.
        spent: Number of fitted parameters.
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
    # With missing pairs the sum may not be positive definite: add white noise.
    spectrum = np.fft.hfft(means, 16 * count)
    least = FLOOR * float(spectrum.mean())
    means[0] = max(QUIET, float(means[0]) + max(0.0, least - float(spectrum.min())))
    return means
