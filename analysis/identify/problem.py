"""The least-squares problem of a fit: whitened residuals, their derivatives, and the solver.

Residuals half a millisecond apart are correlated because of the smoothing, mains hum and errors of
the model. Their autocovariance is estimated from a fit that ignores it, and whitens the next fit,
so that they become independent ones of variance 1. It has rows for the fitted instants only.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import ModelError
from sautereau.analysis.identify.parameters import Parameter
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.analysis.phases.rows import SOLVE
from sautereau.trajectory.motion import Floats

FLOOR = 1e-3  # Smallest value of the noise spectrum, divided by its mean


@dataclass(frozen=True)
class Whitening:
    """Maps the residuals of one press to independent residuals of variance 1 without trends."""

    scale: Floats
    """N, standard deviation at each instant, shape (n,)."""
    factor: Floats
    """Lower Cholesky factor of the correlation, banded, its diagonals as rows; shape (band, n)."""
    trends: Floats
    """Whitened trends, orthonormal; shape (n, trends)."""
    shapes: Floats
    """N, trends before whitening; shape (n, trends)."""

    def __call__(self, residual: Floats) -> Floats:
        """Return the whitened residuals [1] of residuals [N], shape (n,) or (n, columns)."""
        white = _solved(self.factor, (residual.T / self.scale).T)
        return white - self.trends @ (self.trends.T @ white)

    def coloured(self, columns: Floats) -> Floats:
        """Return L'x for the Cholesky factor L of the residuals' covariance.

        Args:
            columns: x, shape (n, columns).
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
    free_offset: bool,
    scale: Floats | float = 1.0,
    step: float = 0.0,
) -> Whitening:
    """Return the whitening of one press.

    Args:
        used: Which of its equidistant instants are fitted.
        covariance: Covariance of the scaled residuals for lags of 0, 1, 2 ... instants; it is 0
            for longer lags.
        free_offset: Whether the force has an unknown offset and an unknown slow ramp.
        scale: N, scale of the residuals; shape (n,) at the fitted instants, or ().
        step: s, between instants. If it is not 0, the force has unknown mains hum.
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
    columns = [np.ones(count), 2 * (at - at[0]) / max(at[-1] - at[0], 1) - 1] if free_offset else []
    # In a shorter record 50 and 60 Hz cannot be separated from the press.
    if (at[-1] - at[0]) * step > 0.15:
        columns += [
            f(2 * np.pi * at * step * mains) for f in (np.sin, np.cos) for mains in (50.0, 60.0)
        ]
    plain = np.stack(columns, 1) if columns else np.zeros((count, 0))
    white = np.stack([_solved(factor, c / scale) for c in columns], 1) if columns else plain
    trends, mixing = np.linalg.qr(white)
    return Whitening(scale, factor, trends, plain @ np.linalg.inv(mixing))


def white(dynamics: InverseDynamics, spread: float, free_offset: bool) -> tuple[Whitening, ...]:
    """Return the whitenings of independent residuals with a standard deviation of `spread` [N]."""
    return tuple(
        whitening(p.used, np.ones(1), free_offset, spread, p.step) for p in dynamics.presses
    )


def _solved(factor: Floats, values: Floats) -> Floats:
    """Solve with a banded lower factor by forward substitution."""
    return np.asarray(SOLVE(factor, values, uplo="L")[0], float)


def autocovariance(
    residuals: Sequence[Floats],
    used: Sequence[NDArray[np.bool_]],
    step: float,
    spent: int,
    floor: float = FLOOR,
) -> Floats:
    """Return a positive definite autocovariance of the residuals for lags of 0, 1, 2 ... instants.

    Args:
        residuals: Residuals of each press at its fitted instants.
        used: Which of the equidistant instants of each press are fitted.
        step: s, between instants.
        spent: Number of fitted values.
        floor: Smallest value of the spectrum, divided by its mean.
    """
    from scipy.signal.windows import parzen

    # The longest lag of the autocovariance is 50 ms, two and a half periods of the mains.
    count = max(2, round(50e-3 / step))
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
    # If pairs are missing, this may not be positive definite. White noise is then added.
    spectrum = np.fft.hfft(means, 16 * count)
    least = floor * float(spectrum.mean())
    # Presses without noise need a smallest variance.
    means[0] = max(1e-12, float(means[0]) + max(0.0, least - float(spectrum.min())))
    return means


TOLERANCE = 1e-6  # Relative decrease of the cost that is neglected in a result
COARSE = 1e-4  # The same in a fit that only serves to estimate the noise
ROUGH = 1e-2  # The same in a fit whose values start that one


@dataclass(frozen=True)
class Problem:
    """Whitened residuals as a function of the scaled parameters."""

    dynamics: InverseDynamics
    scales: Floats
    whitenings: tuple[Whitening, ...]
    rise_factor: float = 1.0
    """Scatter of the rises at release divided by their stated uncertainties."""

    @property
    def free(self) -> tuple[Parameter, ...]:
        """The free parameters."""
        return self.dynamics.free

    def data(self, point: Floats) -> Floats:
        """Return the whitened residuals [1] of the data at a scaled point.

        Raises:
            ModelError: The model has no solution there.
        """
        return self.white(self.dynamics.joined(point * self.scales))

    def white(self, joined: Floats) -> Floats:
        """Return `InverseDynamics.joined`, or columns of its derivatives, whitened."""
        ends = np.cumsum([int(p.used.sum()) for p in self.dynamics.presses])
        *forces, rises = np.split(joined, ends)
        white = [w(f) for w, f in zip(self.whitenings, forces, strict=True)]
        return np.concatenate([*white, rises / self.rise_factor])

    def prior(self, point: Floats) -> Floats:
        """Return the residuals [1] of the priors at a scaled point."""
        means = np.array([p.mean or 0.0 for p in self.free])
        return self.prior_jacobian @ (point - means / self.scales)

    @property
    def prior_jacobian(self) -> Floats:
        """Derivatives of `prior` by the scaled parameters."""
        known = [k for k, p in enumerate(self.free) if p.std is not None]
        return np.diag(self.scales / [p.std or 1.0 for p in self.free])[known]

    def all(self, point: Floats) -> Floats:
        """Return the residuals [1] of data and priors; one that is infinite without a solution."""
        try:
            return np.concatenate([self.data(point), self.prior(point)])
        except ModelError:
            return np.full(1, np.inf)

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Scaled bounds of the parameters."""
        low = np.array([p.low for p in self.free]) / self.scales
        return low, np.array([p.high for p in self.free]) / self.scales

    def differences(self, point: Floats) -> Floats:
        """Return the derivatives of `InverseDynamics.joined` by the scaled parameters.

        They are central differences, one-sided at bounds: for uncertainties, as where several
        parameters do nearly the same, one-sided ones make these up to 25 % too small.
        """
        steps = np.diag([p.difference for p in self.free])
        ends = np.clip(point + np.stack([-steps, steps]), *self.bounds)
        self.dynamics.solve_together((ends * self.scales).reshape(-1, len(point)))
        columns = []
        for first, last in zip(*ends, strict=True):
            before, after = (self.dynamics.joined(end * self.scales) for end in (first, last))
            columns.append((after - before) / (last - first).sum())
        return np.stack(columns, axis=1)

    def slopes(self, point: Floats) -> Floats:
        """Return the derivatives of `all` by one-sided differences, in half the time."""
        slopes = self.dynamics.slopes(point * self.scales, self.scales) * self.scales
        return np.vstack([self.white(slopes), self.prior_jacobian])


def minimise(
    found: Problem,
    values: Floats,
    robust: bool = False,
    fixed: int | None = None,
    tolerance: float = TOLERANCE,
) -> tuple[float, Floats]:
    """Minimise the cost from a start by the Levenberg-Marquardt method.

    A step solves the linear problem between the bounds, so that parameters may end at a bound.
    Return the minimum and the parameters [SI] there.

    Args:
        values: SI, start, shape (parameters,).
        robust: Weight large residuals linearly instead of quadratically.
        fixed: Number of a parameter that keeps its value; None: all are free.
        tolerance: Relative decrease of the cost below which the solver stops.
    """
    from scipy.optimize import lsq_linear

    def cost_of(residuals: Floats) -> float:
        squares = residuals**2
        return float(np.sum(np.sqrt(1 + squares) - 1 if robust else squares / 2))

    low, high = found.bounds
    point = np.clip(values / found.scales, low, high)
    moving = np.arange(len(point)) != fixed
    residuals, damping, r, target = found.all(point), 0.0, None, np.array(())
    cost = cost_of(residuals)
    if not np.isfinite(cost):  # the model has no solution at this start
        return cost, values
    for _ in range(60):  # evaluations of the cost
        if r is None:
            weight = (1 + residuals**2) ** -0.25 if robust else np.ones(len(residuals))
            q, r = np.linalg.qr(found.slopes(point)[:, moving] * weight[:, None])
            target = -q.T @ (weight * residuals)
        # The last part keeps undetermined parameters where they are.
        sizes = np.sqrt(damping) * np.linalg.norm(r, axis=0) + 1e-3
        damped = np.vstack([r, np.diag(sizes)])
        ends = (low - point)[moving], (high - point)[moving]
        step = lsq_linear(damped, np.append(target, np.zeros(len(r))), ends, method="bvls").x
        decrease = float(target @ target - np.sum((target - r @ step) ** 2)) / 2
        if decrease <= tolerance * cost:
            break
        trial = point.copy()
        trial[moving] = np.clip(point[moving] + step, low[moving], high[moving])
        moved = found.all(trial)
        gained = cost - cost_of(moved)
        if gained < decrease / 4:
            damping = max(10 * damping, 1e-3)
        elif gained > decrease * 3 / 4:
            damping /= 10
        if gained > 0:
            point, residuals, cost, r = trial, moved, cost - gained, None
    return cost, np.clip(point * found.scales, *(found.scales * end for end in (low, high)))
