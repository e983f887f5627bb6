"""Identifiability: which combinations of parameters the data determine.

The singular values of the scaled Jacobian are the inverse standard uncertainties of its right
singular vectors.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sautereau.trajectory.motion import Floats

IDENTIFIABLE = 0.015
"""Dimensionless, standard uncertainty over the scale of a parameter below which it is identifiable:
its 95 % interval is at most 3 % of the scale either way."""
LEAST_WEIGHT = 0.1
"""Dimensionless, smallest weight of a parameter that a combination lists."""


@dataclass(frozen=True)
class Combination:
    """A direction among the scaled parameters."""

    weights: dict[str, float]
    """By parameter, of its change over its scale; squares sum to 1, small ones are omitted."""
    std: float | None
    """Dimensionless standard uncertainty of the combination; None where undetermined."""
    identifiable: bool
    """Whether the uncertainty is below `IDENTIFIABLE`."""

    def __str__(self) -> str:
        parts = [f"{'-' if w < 0 else '+'} {abs(w):.2f} {n}" for n, w in self.weights.items()]
        return " ".join(parts).removeprefix("+ ")


def combinations(jacobian: Floats, names: Sequence[str]) -> list[Combination]:
    """Return the combinations of parameters, the best determined first.

    Args:
        jacobian: Of whitened residuals by the scaled parameters, shape (n, parameters).
        names: Of the parameters.
    """
    _, singular, directions = np.linalg.svd(jacobian, full_matrices=False)
    found = []
    for value, direction in zip(singular, directions, strict=True):
        largest = int(np.argmax(np.abs(direction)))
        direction = direction * np.sign(direction[largest])
        order = np.argsort(-np.abs(direction))
        std = 1 / float(value) if value > 1e-9 * max(float(singular[0]), 1e-300) else None
        found.append(
            Combination(
                {
                    names[int(i)]: float(direction[i])
                    for i in order
                    if abs(direction[i]) >= LEAST_WEIGHT
                },
                std,
                std is not None and std < IDENTIFIABLE,
            )
        )
    return found
