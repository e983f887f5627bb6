"""Force laws S(h) of plucks: piecewise cubics."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.model.choirs import pluck_of
from sautereau.rig.instrument import Plectrum, String
from sautereau.trajectory.motion import Floats


@dataclass(frozen=True)
class Law:
    """Force law of a string."""

    cells: Floats
    """Start of each cell [m], and the cubic of the force [N] from there; shape (cells, 5)."""
    first: NDArray[np.int64]
    """First cells where the string sticks and where it slides, and the end of the last; (3,)."""
    border: Floats
    """Heights there [m], equal where the string never sticks or never slides; shape (3,)."""


@lru_cache(maxsize=256)
def law_of(plectrum: Plectrum, string: String, level: str) -> Law:
    """Return the law of one pluck, with the same cubics as its `force_on_jack`.

    Raises:
        ModelError: The plectrum and string have no pluck.
    """
    pluck = pluck_of(plectrum, string, level)  # pyright: ignore[reportArgumentType]
    knots = pluck.height
    places = np.array([1, 3, 5, 7]) / 8
    steps = np.diff(knots)[:, None]
    values = pluck.force_on_jack(knots[:-1, None] + steps * places)
    cubics = np.linalg.solve(np.vander(places, 4, increasing=True), values.T).T
    cells = np.column_stack([knots[:-1], cubics / steps ** np.arange(4)])
    first = np.array([0, pluck.stretches[-1], len(cells)])
    return Law(cells, first, knots[first])
