"""Independent errors that the values of a rig may have, by their assumed ranges."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.rig.schema import Rig

Floats = NDArray[np.float64]
FROM_THE_FRONT = ("key.front_arm", "key.press_arm", "key.laser_arm")
"""Lengths from the balance pin that are measured from the front edge: the place of the pin shifts
all of them together. One that is measured from the pin has no assumed range."""
DRAWS = 10_000  # Of a distribution, for the ends of its 95 % interval to 1 % of its width


@dataclass(frozen=True)
class Deviation:
    """The true value minus the rig's, uniformly distributed; SI."""

    name: str
    """Dotted key."""
    low: float
    high: float
    keys: tuple[str, ...]
    """Dotted keys of all values that have this error."""

    @property
    def std(self) -> float:
        """Root mean square, which is larger if the rig's value is not the middle of its range."""
        return math.sqrt((self.low**2 + self.low * self.high + self.high**2) / 3)

    def applied(self, rig: Rig, change: float) -> Rig:
        """Return the rig after a change of its values [SI]."""
        return rig.replaced({key: value_of(rig, key) + change for key in self.keys})


def value_of(rig: Rig, key: str) -> float:
    """Return a value of the rig by its dotted key [SI]; those of a list have their index in it."""

    def part(holder: Any, name: str) -> Any:
        return holder[int(name)] if name.isdigit() else getattr(holder, name)

    return float(reduce(part, key.split("."), rig))


def drawn(stds: Floats, inputs: Sequence[tuple[Deviation, Floats]]) -> list[Floats]:
    """Return draws of the changes of results by normal errors, and by each uniform one (JCGM 101).

    Args:
        stds: Standard uncertainties by the normal errors, shape (results,).
        inputs: Errors, each with the coefficients of its value over its standard uncertainty and
            of the powers of that, shape (powers, results).

    Returns:
        Arrays of shape (`DRAWS`, results).
    """
    from scipy.special import ndtri
    from scipy.stats import qmc

    draws = qmc.LatinHypercube(1 + len(inputs), rng=np.random.default_rng(0)).random(DRAWS)
    found = [np.outer(ndtri(draws[:, 0]), stds)]
    for (error, coefficients), at in zip(inputs, draws.T[1:], strict=True):
        change = (error.low + (error.high - error.low) * at[:, None]) / error.std
        found.append(change ** np.arange(1, 1 + len(coefficients)) @ coefficients)
    return found


def shared_keys(rig: Rig, key: str) -> tuple[str, ...]:
    """Return the dotted keys of all values that have the error of one of them."""
    shared = tuple(name for name in FROM_THE_FRONT if name in rig.assumed)
    return shared if key in shared else (key,)


def deviations(rig: Rig, names: Iterable[str]) -> list[Deviation]:
    """Return the errors of the values that the rig knows to within a range only.

    Args:
        names: Dotted keys of values, in the rig's tables.
    """
    found = {}
    for name in names:
        keys = shared_keys(rig, name)
        low, high = rig.assumed.get(name, (0.0, 0.0))
        if low < high:
            low, high = (end - value_of(rig, keys[0]) for end in rig.assumed[keys[0]])
            found[keys[0]] = Deviation(keys[0], low, high, keys)
    return list(found.values())
