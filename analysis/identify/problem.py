"""The least-squares problem of a fit: whitened residuals, their derivatives, and the solver."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.identify.noise import Whitening
from sautereau.analysis.identify.parameters import Parameter
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.trajectory.motion import Floats

DIFFERENCE = 1e-3
"""Step of the numerical derivatives over the scale of the parameter."""
AT_BOUND = 1e-6
"""Fraction of the range of a parameter within which it counts as at a bound."""
TOLERANCE = 1e-8
"""Relative tolerance of the solver."""
UNSOLVED = 1e6
"""Residual of every datum where the model has no solution, so that the solver rejects the step."""


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
            count = sum(int(p.used.sum()) + len(p.releases) for p in self.dynamics.presses)
            found = np.full(count, UNSOLVED)
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
        for k in range(len(point)):
            ends = []
            for end in (point[k] - DIFFERENCE, point[k] + DIFFERENCE):
                moved = point.copy()
                moved[k] = min(max(end, low[k]), high[k])
                ends.append(moved)
            width = ends[1][k] - ends[0][k]
            columns.append((residuals(ends[1]) - residuals(ends[0])) / width)
        return np.stack(columns, axis=1)


def descend(
    found: Problem, values: Floats, robust: bool = False, fixed: int | None = None
) -> tuple[float, Floats]:
    """Return the minimum of the cost reached from a start, and the parameters [SI] there.

    Args:
        found: The problem.
        values: SI, the start, shape (parameters,).
        robust: Weight large residuals linearly instead of quadratically.
        fixed: Index of a parameter that keeps its value; None for none.
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
        jac=lambda part: found.jacobian(complete(part), found.all)[:, moving],  # pyright: ignore[reportArgumentType]
        bounds=(low[moving], high[moving]),
        loss="soft_l1" if robust else "linear",
        xtol=TOLERANCE,
        ftol=TOLERANCE,
        gtol=None,  # pyright: ignore[reportArgumentType]
        max_nfev=60,
    )
    point = complete(result.x)
    # The solver stays inside the bounds; move parameters that are as good as at a bound onto it.
    for end in (low, high):
        near = np.abs(point - end) <= AT_BOUND * (high - low)
        point = np.where(near, end, point)
    return float(result.cost), point * found.scales
