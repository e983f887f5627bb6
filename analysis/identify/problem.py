"""The least-squares problem of a fit: whitened residuals, their derivatives, and the solver."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.analysis.identify.parameters import DIFFERENCE, Parameter
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.analysis.identify.whitening import Whitening
from sautereau.trajectory.motion import Floats

AT_BOUND = 1e-6  # A parameter is at a bound if it is closer to it than this fraction of its range
TOLERANCE = 1e-6  # Relative tolerance of the solver for a result
COARSE = 1e-4  # Relative tolerance of the solver for a fit that only serves to estimate the noise
UNSOLVED = 1e6
"""Value of every residual where the model has no solution. The solver then rejects the step."""


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
        forces, rises = self.dynamics.residuals(point * self.scales)
        white = [w(f) for w, f in zip(self.whitenings, forces, strict=True)]
        return np.concatenate([*white, rises / self.rise_factor])

    def by_another(
        self, data: Floats, dynamics: InverseDynamics, values: Floats, step: float
    ) -> Floats | None:
        """Return the derivative of `data` by a number that is not a parameter.

        It is None if the model has no solution after the step.

        Args:
            data: Residuals before the step.
            dynamics: Inverse dynamics after the step.
            values: SI, values of its parameters.
        """
        moved = replace(self, dynamics=dynamics, scales=np.ones(len(values)))
        try:
            return (moved.data(values) - data) / step
        except ModelError:
            return None

    @property
    def _expected(self) -> list[int]:
        """Numbers of the parameters that have a prior."""
        return [k for k, p in enumerate(self.free) if p.std is not None]

    def prior(self, point: Floats) -> Floats:
        """Return the residuals [1] of the priors at a scaled point."""
        means = np.array([p.mean or 0.0 for p in self.free])
        return self.prior_jacobian @ (point - means / self.scales)

    @property
    def prior_jacobian(self) -> Floats:
        """Derivatives of `prior` by the scaled parameters."""
        return np.diag(self.scales / [p.std or 1.0 for p in self.free])[self._expected]

    def all(self, point: Floats) -> Floats:
        """Return the residuals [1] of data and priors; `UNSOLVED` if there is no solution."""
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
        """Return the derivatives of `residuals` by central differences, one-sided at bounds."""
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
        """Return the derivatives of `all` by one-sided differences, in half the time."""
        low, high = self.bounds
        steps = np.where(point + DIFFERENCE <= high, DIFFERENCE, -DIFFERENCE)
        at, columns = self.all(point), []
        for step in np.diag(np.clip(point + steps, low, high) - point):
            columns.append((self.all(point + step) - at) / step.sum())
        return np.stack(columns, axis=1)


def minimise(
    found: Problem,
    values: Floats,
    robust: bool = False,
    fixed: int | None = None,
    tolerance: float = TOLERANCE,
) -> tuple[float, Floats]:
    """Minimise the cost from a start; return the minimum and the parameters [SI] there.

    Args:
        values: SI, start, shape (parameters,).
        robust: Weight large residuals linearly instead of quadratically.
        fixed: Number of a parameter that keeps its value; None: all are free.
        tolerance: Relative tolerance of cost and parameters.
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
        jac=lambda part: found.slopes(complete(part))[:, moving],  # type: ignore
        bounds=(low[moving], high[moving]),
        loss="soft_l1" if robust else "linear",
        xtol=tolerance,
        ftol=tolerance,
        gtol=None,  # pyright: ignore[reportArgumentType]
        max_nfev=40,
    )
    point = complete(result.x)
    # The solver stays inside the bounds: move parameters that are almost at a bound onto it.
    for end in (low, high):
        near = np.abs(point - end) <= AT_BOUND * (high - low)
        point = np.where(near, end, point)
    return float(result.cost), point * found.scales
