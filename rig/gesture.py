"""A recorded gesture: a text file of the jack's rise over time."""

from pathlib import Path

from sautereau.rig.tables import read_table
from sautereau.rig.units import parse_quantity

_SI = {"time": "s", "rise": "m"}


def read_gesture(path: Path) -> dict[str, list[str]]:
    """Read a CSV file with the columns time and rise, as a rig file would hold them.

    The first row names the columns, with their units: ``time [s], rise [mm]``; without
    one, s and m are meant.

    Raises:
        RigError: The file cannot be read, a column is missing, or a cell is no number.
    """
    return read_table(path, "gesture file", _SI, "time [s], rise [mm]", _quantity)


def _quantity(name: str, text: str) -> str:
    """Return a cell's text, having seen that it is a quantity of the column's dimension."""
    parse_quantity(text, _SI[name])
    return text
