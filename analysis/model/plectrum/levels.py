"""The levels of the plectrum by name; a level's file is imported when it is first asked for."""

from typing import TYPE_CHECKING

from sautereau.analysis.errors import ModelError
from sautereau.rig.registry import Registry

if TYPE_CHECKING:
    from sautereau.analysis.model.plectrum.base import PlectrumMap
    from sautereau.rig.instrument import Plectrum

_HERE = "sautereau.analysis.model.plectrum"
LEVELS = Registry(
    "sautereau.plectrum_levels",
    "plectrum level",
    {
        "elastica": f"{_HERE}.elastica:Elastica",
        "fe": f"{_HERE}.fe.level:FE",
        "rods": f"{_HERE}.rods:Rods",
        "beam": f"{_HERE}.beam:Beam",
        "two-beam": f"{_HERE}.beam:TwoBeam",
    },
    ModelError,
)
"""Classes that are constructed from a `Plectrum` and are a `PlectrumMap`; the default first."""


def plectrum_map(plectrum: "Plectrum", level: str) -> "PlectrumMap":
    """Return the map of a plectrum at a level.

    Raises:
        ModelError: There is no such level, or the plectrum is out of its range.
    """
    return LEVELS.get(level)(plectrum)


def levels_help() -> str:
    """Return the help text of an option that takes a level, with all registered names."""
    notes = {"elastica": " (default)", "fe": " (carved shape)"}
    return f"Plectrum bending model: {', '.join(n + notes.get(n, '') for n in LEVELS.names())}."
