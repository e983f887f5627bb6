"""Can these data tell these numbers apart? The singular values of the scaled Jacobian answer."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sautereau.trajectory.motion import Floats

IDENTIFIABLE = 0.015
"""1, standard uncertainty over the parameter's scale below which data tell it: the 95 % interval
reaches no further than 3 % of the scale."""
SHARE = 0.1
"""1, least weight with which a parameter is named in a combination."""


@dataclass(frozen=True)
class Combination:
    """A direction among the scaled parameters."""

    weights: dict[str, float]
    """1, by parameter, of its change over its scale; the squares sum to 1, small ones left out."""
    std: float | None
    """1, standard uncertainty of the combination; None where nothing bounds it."""
    identifiable: bool
    """Whether that is below `IDENTIFIABLE`."""

    def __str__(self) -> str:
        parts = [f"{'-' if w < 0 else '+'} {abs(w):.2f} {n}" for n, w in self.weights.items()]
        return " ".join(parts).removeprefix("+ ")


def combinations(jacobian: Floats, names: Sequence[str]) -> list[Combination]:
    """Return the combinations that data tell apart, the best told first.

    Args:
        jacobian: Of whitened residuals by the scaled parameters [1], shape (n, parameters).
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
                {names[int(i)]: float(direction[i]) for i in order if abs(direction[i]) >= SHARE},
                std,
                std is not None and std < IDENTIFIABLE,
            )
        )
    return found
