"""The models of Galil's motion controllers: their axes, and the commands that they lack.

The table is `galil_models.csv`, after the lists of models in the manufacturer's command reference.
Of the commands, only those count that the emulated controller knows. Driver and stand-in read it.
"""

import functools
import re
from dataclasses import dataclass
from typing import Self

from sautereau.rig.disk import table_beside

PVT = frozenset({"PV", "BT"})
"""Commands, and operands, of motions with position, velocity and time."""


@dataclass(frozen=True)
class GalilModel:
    """One model with its firmware."""

    family: str
    """Family, as the command reference names it."""
    axes: int
    """Number of axes; their letters begin with A."""
    absent: frozenset[str]
    """Commands, and operands, that model or firmware does not know."""

    @classmethod
    def of(cls, revision: str) -> Self | None:
        """Return the model of an answer to ^R^V such as `DMC4020 Rev 1.3a`; None if unknown."""
        named = re.match(r"DMC(\d+)(?!\S)(?: Rev (\S*))?", revision)
        for family, _, pattern, absent in _table():
            if named and (found := re.fullmatch(pattern, named[1])):
                fast = PVT if "-FAST" in (named[2] or "") else frozenset()
                return cls(family, int(found[1]), frozenset(absent.split()) | fast)
        return None


@functools.cache
def _table() -> list[list[str]]:
    return table_beside(__file__)


def families(needed: frozenset[str] = frozenset()) -> list[str]:
    """Return the names of the families that have all of the commands and a second axis."""
    return [
        name
        for _, name, pattern, absent in _table()
        if not needed & set(absent.split()) and (not needed or "(1)" not in pattern)
    ]
