"""Least squares in a few parameters by Levenberg and Marquardt's method.

The residuals are those after elimination of the linear factors (variable projection: L. Kaufman,
BIT 15 (1975) 49), so that their derivatives are known only approximately; a step is accepted only
if it reduces the sum of squares.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.trajectory.motion import Floats

Evaluated = tuple[NDArray[Any], ...]
"""Residuals of states, shape (m, n), and what else their slopes need, arrays of shape (m, ...)."""


@dataclass(frozen=True)
class Minima:
    """The ends of several searches."""

    states: Floats
    """Shape (m, k)."""
    found: Evaluated
    """What `evaluate` returned for each."""
    chi2: Floats
    """Sums of squared residuals, shape (m,)."""
    normal: Floats
    """Normal equations before the last step of each, shape (m, k, k)."""


def minimise(
    states: Floats,
    evaluate: Callable[[Floats], Evaluated],
    slopes: Callable[[Floats, Evaluated], Floats],
    permitted: Callable[[Floats, Evaluated], NDArray[np.bool_]],
    bounded: Callable[[Floats], Floats],
    longest: Floats | float,
    converged: float,
) -> Minima:
    """Return states with smaller residuals, of searches that do not depend on each other.

    They advance together, since the arrays of one are so small that most time would be spent
    between the operations.

    Args:
        states: The starts, shape (m, k).
        evaluate: Evaluates as many states as it is given.
        slopes: Returns the derivatives of the residuals, shape (m, n, k).
        permitted: Returns which states may be a result, shape (m,).
        bounded: Returns the nearest states within bounds.
        longest: Largest change of a state by one step, in its unit; shape (k,) or a number.
        converged: Dimensionless, relative decrease of the sum of squares at which a search ends.
    """
    states = states.copy()
    found = evaluate(states)
    m, k = states.shape
    total, stiff = (found[0] ** 2).sum(1), np.full(m, 1e-2)
    diagonal = np.eye(k)
    normal, active = np.tile(diagonal, (m, 1, 1)), np.arange(m)
    for _ in range(12):
        at = tuple(each[active] for each in found)
        jacobian = slopes(states[active], at)
        normal[active] = jacobian.swapaxes(1, 2) @ jacobian
        right = np.zeros((m, k))
        right[active] = (at[0][:, None] @ jacobian)[:, 0]
        before, trying = total.copy(), active
        for _ in range(4):  # dampings of this step
            of = normal[trying]
            damped = of + (stiff[trying, None, None] * of + 1e-12) * diagonal
            step = np.linalg.solve(damped, right[trying][..., None])[..., 0]
            trials = bounded(states[trying] - np.clip(step, -longest, longest))
            made = evaluate(trials)
            chi2 = (made[0] ** 2).sum(1)
            good = (chi2 < total[trying]) & permitted(trials, made)
            better = trying[good]
            states[better], total[better] = trials[good], chi2[good]
            for kept, each in zip(found, made, strict=True):
                kept[better] = each[good]
            stiff[better] = np.maximum(stiff[better] / 5, 1e-7)
            trying = trying[~good]
            stiff[trying] *= 5
            if not len(trying):
                break
        active = active[before[active] - total[active] > converged * before[active]]
        if not len(active):
            break
    return Minima(states, found, total, normal)


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
