"""Touches: a text file of the key's points that a jogged fingertip touched."""

import math
from pathlib import Path
from typing import NamedTuple

from sautereau.rig.schema import Arm
from sautereau.rig.tables import read_table
from sautereau.rig.units import parse_quantity

_SI = {"point": "m", "joint1": "rad", "joint2": "rad"}
_EXAMPLE = "point [mm], joint1 [counts], joint2 [counts]"


class Touches(NamedTuple):
    """What m touches say."""

    points: tuple[float, ...]
    """m, along the key from the balance pin, negative in front of it."""
    joints: tuple[tuple[float, float], ...]
    """rad, readings of joints 1 and 2."""


def read_touches(path: Path, arm: Arm) -> Touches:
    """Read a CSV file with the columns point, joint1 and joint2.

    The first row names the columns, with their units: ``point [mm], joint1 [counts],
    joint2 [counts]``; joints may also be angles, and without a unit m and rad are meant.

    Args:
        path: The file.
        arm: The arm, whose encoders count.

    Raises:
        RigError: The file cannot be read, a column is missing, or a cell is no number.
    """

    def read(name: str, text: str) -> float:
        number, _, unit = text.rpartition(" ")
        if name == "point" or unit not in ("counts", "count"):
            return parse_quantity(text, _SI[name])
        counts = parse_quantity(number, "")
        return counts * 2 * math.pi / arm.counts_per_revolution

    table = read_table(path, "touches file", _SI, _EXAMPLE, read)
    return Touches(tuple(table["point"]), tuple(zip(table["joint1"], table["joint2"], strict=True)))
