"""Independent errors that the values of a rig may have, by their assumed ranges."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import reduce

from sautereau.rig.schema import Rig

FROM_THE_FRONT = ("key.front_arm", "key.press_arm", "key.laser_arm")
"""Lengths from the balance pin that are measured from the front edge: the place of the pin shifts
all of them together. One that is measured from the pin has no assumed range."""


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
    """Return a value of one of the rig's tables by its dotted key [SI]."""
    return float(reduce(getattr, key.split("."), rig))


def deviations(rig: Rig, names: Iterable[str]) -> list[Deviation]:
    """Return the errors of the values that the rig knows to within a range only.

    Args:
        names: Dotted keys of values, in the rig's tables.
    """
    shared = tuple(name for name in FROM_THE_FRONT if name in rig.assumed)
    found = {}
    for name in names:
        keys = shared if name in shared else (name,)
        if rig.assumed.get(name, (0, 0))[0] < rig.assumed.get(name, (0, 0))[1]:
            low, high = (end - value_of(rig, keys[0]) for end in rig.assumed[keys[0]])
            found[keys[0]] = Deviation(keys[0], low, high, keys)
    return list(found.values())
