"""The least-squares problem of a fit: whitened residuals, their derivatives, and the solver.

Residuals half a millisecond apart are correlated: by the smoothing, by mains hum, by errors of
the model. Their autocovariance, estimated from a fit that ignores it, whitens the next fit.
Excluded instants are not in the covariance.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import ModelError
from sautereau.analysis.identify.parameters import DIFFERENCE, Parameter
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.analysis.phases.signals import SOLVE
from sautereau.trajectory.motion import Floats

AT_BOUND = 1e-6
"""Fraction of the range of a parameter within which it counts as at a bound."""
TOLERANCE, COARSE = 1e-6, 1e-4
"""Relative tolerances of the solver: of a result, and of a fit that only shows the noise."""
UNSOLVED = 1e6
"""Residual of every datum where the model has no solution, so that the solver rejects the step."""
REACH = 50e-3
"""s, longest lag of the autocovariance: two and a half periods of the mains."""
MAINS, HUM_LEAST = (50.0, 60.0), 0.15
"""Hz, of the mains, and the shortest record [s] in which both are separated from the press."""
FLOOR = 1e-3
"""Dimensionless, smallest value of the noise spectrum over its mean."""
QUIET = 1e-12
"""Smallest variance of scaled residuals, for presses without noise."""


@dataclass(frozen=True)
class Whitening:
    """Maps residuals of one press to independent ones of variance 1, without unknown trends."""

    scale: Floats
    """N, standard deviation at each instant, shape (n,)."""
    factor: Floats
    """Lower Cholesky factor of the correlation, banded, diagonals as rows: shape (band, n)."""
    trends: Floats
    """Whitened trends, orthonormal; shape (n, trends)."""
    shapes: Floats
    """N, the same trends before whitening; shape (n, trends)."""

    def __call__(self, residual: Floats) -> Floats:
        """Return the whitened residuals [1] of residuals [N], shape (n,)."""
        white = _solved(self.factor, residual / self.scale)
        return white - self.trends @ (self.trends.T @ white)

    def coloured(self, columns: Floats) -> Floats:
        """Return columns whose squares have the sum x' S x, for the covariance S of residuals.

        Args:
            columns: Of the residuals' unit, shape (n, columns).
        """
        scaled, found = columns * self.scale[:, None], np.zeros_like(columns)
        for row, diagonal in enumerate(self.factor):
            count = len(scaled) - row
            found[:count] += diagonal[:count, None] * scaled[row:]
        return found

    def trend(self, residual: Floats) -> Floats:
        """Return the trend [N] in residuals [N], shape (n,)."""
        return self.shapes @ (self.trends.T @ _solved(self.factor, residual / self.scale))


def whitening(
    used: NDArray[np.bool_],
    covariance: Floats,
    levelled: bool,
    scale: Floats | float = 1.0,
    step: float = 0.0,
) -> Whitening:
    """Return the whitening of one press.

    Args:
        used: Which of its equidistant instants are fitted.
        covariance: Of residuals over their scale, over the lag in instants, from 0; longer lags
            have covariance 0.
        levelled: Whether the force has an unknown level and an unknown slow ramp, because of AC
            coupling.
        scale: N, of the residuals; shape (n,) of the fitted instants, or ().
        step: s, between instants: the force then has unknown hum of the mains; 0 for none.
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
    scale = np.broadcast_to(scale, count)
    columns = [np.ones(count), 2 * (at - at[0]) / max(at[-1] - at[0], 1) - 1] if levelled else []
    if (at[-1] - at[0]) * step > HUM_LEAST:
        columns += [f(2 * np.pi * at * step * mains) for f in (np.sin, np.cos) for mains in MAINS]
    plain = np.stack(columns, 1) if columns else np.zeros((count, 0))
    white = np.stack([_solved(factor, c / scale) for c in columns], 1) if columns else plain
    trends, mixing = np.linalg.qr(white)
    return Whitening(scale, factor, trends, plain @ np.linalg.inv(mixing))


def white(dynamics: InverseDynamics, spread: float, levelled: bool) -> tuple[Whitening, ...]:
    """Return whitenings for independent residuals of a standard deviation [N]."""
    return tuple(whitening(p.used, np.ones(1), levelled, spread, p.step) for p in dynamics.presses)


def _solved(factor: Floats, values: Floats) -> Floats:
    """Return the solution for a banded lower factor by forward substitution."""
    return np.asarray(SOLVE(factor, values, uplo="L")[0], float)


def autocovariance(
    residuals: Sequence[Floats],
    used: Sequence[NDArray[np.bool_]],
    step: float,
    spent: int,
    floor: float = FLOOR,
) -> Floats:
    """Return a positive definite autocovariance of the residuals over the lag in instants.

    Args:
        residuals: N, of each press at its used instants.
        used: Which of the equidistant instants of each press those are.
        step: s, between instants.
        spent: Number of fitted parameters.
        floor: Dimensionless, smallest value of the spectrum over its mean.
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
    least = floor * float(spectrum.mean())
    means[0] = max(QUIET, float(means[0]) + max(0.0, least - float(spectrum.min())))
    return means


@dataclass(frozen=True)
class Problem:
    """Whitened residuals as a function of the scaled parameters, for one model of the noise."""

    dynamics: InverseDynamics
    scales: Floats
    whitenings: tuple[Whitening, ...]
    rise_factor: float = 1.0
    """Scatter of the rises at release over their stated uncertainties."""

    @property
    def free(self) -> tuple[Parameter, ...]:
        """The free parameters."""
        return self.dynamics.free

    def data(self, point: Floats) -> Floats:
        """Return the whitened residuals [1] of the data at a scaled point.

        Raises:
            ModelError: The model has no solution there.
        """
        forces, rises = self.dynamics.residuals(point * self.scales)
        white = [w(f) for w, f in zip(self.whitenings, forces, strict=True)]
        return np.concatenate([*white, rises / self.rise_factor])

    def by_another(
        self, data: Floats, dynamics: InverseDynamics, values: Floats, step: float
    ) -> Floats | None:
        """Return the derivative of `data` by a number that is not a parameter; None without one.

        Args:
            data: Without the step.
            dynamics: With the step of the number.
            values: SI, of its parameters.
            step: Of the number.
        """
        moved = replace(self, dynamics=dynamics, scales=np.ones(len(values)))
        try:
            return (moved.data(values) - data) / step
        except ModelError:
            return None

    @property
    def _expected(self) -> list[int]:
        """Indices of the parameters that have a prior with a mean."""
        return [k for k, p in enumerate(self.free) if p.std is not None]

    @property
    def nuisances(self) -> list[int]:
        """Rows of `prior` that belong to hidden parameters."""
        return [row for row, k in enumerate(self._expected) if self.free[k].hidden]

    def prior(self, point: Floats) -> Floats:
        """Return the residuals [1] of the priors at a scaled point."""
        means = np.array([p.mean or 0.0 for p in self.free])
        jacobian = self.prior_jacobian(point)
        return jacobian @ (point - means / self.scales)

    def prior_jacobian(self, point: Floats) -> Floats:
        """Return the derivatives of `prior` by the scaled parameters."""
        rows = np.zeros((len(self._expected), len(point)))
        for row, k in enumerate(self._expected):
            rows[row, k] = self.scales[k] / (self.free[k].std or 1.0)
        return rows

    def all(self, point: Floats) -> Floats:
        """Return the residuals [1] of data and priors; `UNSOLVED` where there is no solution."""
        try:
            found = self.data(point)
        except ModelError:
            count = sum(int(p.used.sum()) for p in self.dynamics.presses)
            found = np.full(count + len(self.dynamics.rise_stds), UNSOLVED)
        return np.concatenate([found, self.prior(point)])

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Scaled bounds of the parameters."""
        low = np.array([p.low for p in self.free]) / self.scales
        return low, np.array([p.high for p in self.free]) / self.scales

    def jacobian(self, point: Floats, residuals: Callable[[Floats], Floats]) -> Floats:
        """Return the derivatives by the scaled parameters, central except at bounds."""
        low, high = self.bounds
        columns = []
        for k, parameter in enumerate(self.free):
            ends = []
            for end in (point[k] - parameter.difference, point[k] + parameter.difference):
                moved = point.copy()
                moved[k] = min(max(end, low[k]), high[k])
                ends.append(moved)
            width = ends[1][k] - ends[0][k]
            columns.append((residuals(ends[1]) - residuals(ends[0])) / width)
        return np.stack(columns, axis=1)

    def slopes(self, point: Floats) -> Floats:
        """Return the derivatives of `all`, one-sided: less exact, in half the time."""
        low, high = self.bounds
        steps = np.where(point + DIFFERENCE <= high, DIFFERENCE, -DIFFERENCE)
        at, columns = self.all(point), []
        for k, end in enumerate(np.clip(point + steps, low, high).tolist()):
            moved = point.copy()
            moved[k] = end
            columns.append((self.all(moved) - at) / (end - point[k]))
        return np.stack(columns, axis=1)


def descend(
    found: Problem,
    values: Floats,
    robust: bool = False,
    fixed: int | None = None,
    tolerance: float = TOLERANCE,
) -> tuple[float, Floats]:
    """Return the minimum of the cost reached from a start, and the parameters [SI] there.

    Args:
        found: The problem.
        values: SI, the start, shape (parameters,).
        robust: Weight large residuals linearly instead of quadratically.
        fixed: Index of a parameter that keeps its value; None for none.
        tolerance: Relative, of the cost and of the parameters.
    """
    from scipy.optimize import least_squares

    low, high = found.bounds
    moving = np.arange(len(values)) != fixed
    start = np.clip(values / found.scales, low, high)

    def complete(part: Floats) -> Floats:
        point = start.copy()
        point[moving] = part
        return point

    if not moving.any():
        residuals = found.all(start)
        return float(residuals @ residuals) / 2, values
    result = least_squares(
        lambda part: found.all(complete(part)),
        start[moving],
        jac=lambda part: found.slopes(complete(part))[:, moving],  # pyright: ignore[reportArgumentType]
        bounds=(low[moving], high[moving]),
        loss="soft_l1" if robust else "linear",
        xtol=tolerance,
        ftol=tolerance,
        gtol=None,  # pyright: ignore[reportArgumentType]
        max_nfev=40,
    )
    point = complete(result.x)
    # The solver stays inside the bounds; move parameters that are as good as at a bound onto it.
    for end in (low, high):
        near = np.abs(point - end) <= AT_BOUND * (high - low)
        point = np.where(near, end, point)
    return float(result.cost), point * found.scales
