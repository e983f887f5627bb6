"""Least squares in a few parameters by Levenberg and Marquardt's method.

The residuals are those after elimination of the linear factors (variable projection: L. Kaufman,
BIT 15 (1975) 49), so that their derivatives are known only approximately; a step is accepted only
if it reduces the sum of squares.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from sautereau.trajectory.motion import Floats

Found = TypeVar("Found")
STEPS = 12  # Largest number of steps
TRIALS = 4  # Largest number of dampings that are tried for a step
STIFFER = 5.0  # Factor between these dampings
FIRST_STIFFNESS = 1e-2  # Dimensionless damping of the first step
LEAST_STIFFNESS = 1e-7  # Smallest dimensionless damping
RIDGE = 1e-12  # Added to the normal equations


@dataclass(frozen=True)
class Minimum(Generic[Found]):
    """The end of a search."""

    state: Floats
    """Shape (k,)."""
    residuals: Floats
    """Residuals, shape (n,)."""
    found: Found
    """What else `evaluate` returned."""
    normal: Floats
    """Normal equations before the last step, shape (k, k)."""

    @property
    def chi2(self) -> float:
        """Sum of squared residuals."""
        return float(self.residuals @ self.residuals)


def minimise(
    state: Floats,
    evaluate: Callable[[Floats], tuple[Floats, Found]],
    slopes: Callable[[Floats, Found], Floats],
    permitted: Callable[[Floats, Found], bool],
    bounded: Callable[[Floats], Floats],
    longest: Floats | float,
    converged: float,
) -> Minimum[Found]:
    """Return a state with smaller residuals.

    Args:
        state: The start, shape (k,).
        evaluate: Returns residuals, shape (n,), and what `slopes` needs.
        slopes: Returns the derivatives of the residuals, shape (n, k).
        permitted: Returns whether a state may be the result.
        bounded: Returns the nearest state within bounds.
        longest: Largest change of the state by one step, in its unit; shape (k,) or a number.
        converged: Dimensionless, relative decrease of the sum of squares at which it ends.
    """
    left, found = evaluate(state)
    normal = diagonal = np.eye(len(state))
    total, stiff = float(left @ left), FIRST_STIFFNESS
    for _ in range(STEPS):
        jacobian = slopes(state, found)
        normal, right = jacobian.T @ jacobian, jacobian.T @ left
        before = total
        for _ in range(TRIALS):
            damped = normal + (stiff * normal + RIDGE) * diagonal
            step = np.linalg.solve(damped, right)
            step = np.minimum(np.maximum(step, -longest), longest)
            trial = bounded(state - step)
            tried, made = evaluate(trial)
            if (chi2 := float(tried @ tried)) < total and permitted(trial, made):
                state, left, found, total = trial, tried, made, chi2
                stiff = max(stiff / STIFFER, LEAST_STIFFNESS)
                break
            stiff *= STIFFER
        if before - total <= converged * before:
            break
    return Minimum(state, left, found, normal)


def orthonormal(columns: Floats) -> tuple[Floats, Floats]:
    """Return an orthonormal base of columns, and the inverse of its triangular factor.

    By Cholesky's factorisation of their products, which takes half the time of reflections. The
    base is orthogonal to the rounding error times the squared condition of the columns, so rows of
    priors must bound that.

    Args:
        columns: Shape (..., n, k).

    Returns:
        Shape (..., n, k), and what the columns must be multiplied by for it, (..., k, k).
    """
    lower = np.linalg.cholesky(columns.swapaxes(-1, -2) @ columns)
    inverse = np.asarray(np.linalg.inv(lower).swapaxes(-1, -2), dtype=float)
    return columns @ inverse, inverse
