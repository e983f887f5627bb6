"""The least squares of a fit: whitened residuals, their derivatives, and the way down."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.identify.noise import Whitening
from sautereau.analysis.identify.parameters import Parameter
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.trajectory.motion import Floats

DIFFERENCE = 1e-3
"""1, of a parameter's scale, by which it is changed for a derivative."""
AT_BOUND = 1e-6
"""1, of a parameter's range, within which it lies at a bound."""
TOLERANCE = 1e-8
"""1, of a fit."""
UNSOLVED = 1e6
"""1, residual of every datum where the model has no solution: such a step is refused."""


@dataclass(frozen=True)
class Problem:
    """Whitened residuals over points in the parameters' scales, around one noise."""

    dynamics: InverseDynamics
    scales: Floats
    whitenings: tuple[Whitening, ...]
    rise_factor: float = 1.0
    """1, by which rises at release scatter more than their uncertainties say."""

    @property
    def free(self) -> tuple[Parameter, ...]:
        """What is fitted."""
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
        """Places of the parameters that have a prior with a mean."""
        return [k for k, p in enumerate(self.free) if p.std is not None]

    @property
    def nuisances(self) -> list[int]:
        """Rows of `prior` that belong to parameters that are not shown."""
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
        """Return the residuals [1] of data and priors; very large ones outside the model."""
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
        """Return the derivatives by the scaled parameters, across the point where bounds let it."""
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
    """Return the least cost from a start, and the parameters [SI] there.

    Args:
        found: What is to be made small.
        values: SI, the start.
        robust: Let large residuals count in proportion.
        fixed: Place of a parameter that keeps its value; None for none.
    """
    from scipy.optimize import least_squares

    low, high = found.bounds
    moving = np.arange(len(values)) != fixed
    begun = np.clip(values / found.scales, low, high)

    def whole(part: Floats) -> Floats:
        point = begun.copy()
        point[moving] = part
        return point

    if not moving.any():
        residuals = found.all(begun)
        return float(residuals @ residuals) / 2, values
    result = least_squares(
        lambda part: found.all(whole(part)),
        begun[moving],
        jac=lambda part: found.jacobian(whole(part), found.all)[:, moving],  # pyright: ignore[reportArgumentType]
        bounds=(low[moving], high[moving]),
        loss="soft_l1" if robust else "linear",
        xtol=TOLERANCE,
        ftol=TOLERANCE,
        gtol=None,  # pyright: ignore[reportArgumentType]
        max_nfev=60,
    )
    point = whole(result.x)
    # The solver stays inside its bounds; what is as good as at one is put there.
    for end in (low, high):
        near = np.abs(point - end) <= AT_BOUND * (high - low)
        point = np.where(near, end, point)
    return float(result.cost), point * found.scales
