"""Combinations of parameters and their uncertainties, from the Jacobian of a fit.

The right singular vectors of the scaled Jacobian are combinations of parameters. The singular
values are the inverses of their standard uncertainties.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sautereau.trajectory.motion import Floats

UNDETERMINED = 1e-7
"""A combination is undetermined if its singular value is below this fraction of the largest."""
IDENTIFIABLE = 0.025
"""A parameter is identifiable if its standard uncertainty, divided by its scale, is below this. The
ends of its 95 % interval are then at most 5 % of the scale from the value."""
LEAST_WEIGHT = 0.1
"""Smallest weight of a parameter that is listed in a combination."""


@dataclass(frozen=True)
class Combination:
    """A combination of the scaled parameters."""

    weights: dict[str, float]
    """Weight of each parameter's scaled change. The squares sum to 1; small weights are omitted."""
    std: float | None
    """Total standard uncertainty of the combination, dimensionless; None if undetermined."""
    identifiable: bool
    """Whether the uncertainty is below `IDENTIFIABLE`."""

    def __str__(self) -> str:
        parts = [f"{'-' if w < 0 else '+'} {abs(w):.2f} {n}" for n, w in self.weights.items()]
        return " ".join(parts).removeprefix("+ ")


def covariance_of(jacobian: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Return the covariance of the parameters, and which of them are determined.

    Args:
        jacobian: Derivatives of independent residuals of variance 1, shape (n, parameters).
    """
    _, singular, directions = np.linalg.svd(jacobian, full_matrices=False)
    seen = singular > UNDETERMINED * max(float(singular[0]), 1e-300)
    bounded = np.all(np.abs(directions[~seen]) < 1e-3, axis=0)
    kept = directions[seen] / singular[seen, None]
    return kept.T @ kept, bounded


def without_hidden(data: Floats, hidden_prior: Floats, shown: Sequence[int]) -> Floats:
    """Return the Jacobian by the reported parameters, orthogonal to that by the hidden ones.

    Args:
        data: Jacobian by all parameters, shape (n, parameters).
        hidden_prior: Jacobian of the priors of the hidden parameters, shape (priors, parameters).
    """
    hidden = [k for k in range(data.shape[1]) if k not in shown]
    if not hidden:
        return data
    own = np.vstack([data, hidden_prior])
    base, _ = np.linalg.qr(own[:, hidden])
    return own[:, shown] - base @ (base.T @ own[:, shown])


def combinations(jacobian: Floats, names: Sequence[str], inputs: Floats) -> list[Combination]:
    """Return the combinations of parameters, those best determined by the data first.

    Args:
        jacobian: Jacobian of the whitened residuals by the scaled parameters, shape
            (n, parameters).
        inputs: Changes of the scaled parameters by the standard uncertainties of fixed numbers,
            shape (inputs, parameters).
    """
    _, singular, directions = np.linalg.svd(jacobian, full_matrices=False)
    found = []
    for value, direction in zip(singular, directions, strict=True):
        largest = int(np.argmax(np.abs(direction)))
        direction = direction * np.sign(direction[largest])
        listed = [i for i in np.argsort(-np.abs(direction)) if abs(direction[i]) >= LEAST_WEIGHT]
        weights = {names[int(i)]: float(direction[i]) for i in listed}
        seen = value > 1e-9 * max(float(singular[0]), 1e-300)
        std = float(np.linalg.norm([1 / value, *(inputs @ direction)])) if seen else None
        found.append(Combination(weights, std, std is not None and std < IDENTIFIABLE))
    return found
