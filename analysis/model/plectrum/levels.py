"""The levels of the plectrum by name; a level's file is imported when it is first asked for."""

from typing import TYPE_CHECKING

from sautereau.analysis.errors import ModelError
from sautereau.rig.registry import Registry

if TYPE_CHECKING:
    from sautereau.analysis.model.plectrum.base import PlectrumMap
    from sautereau.rig.instrument import Plectrum

_HERE = "sautereau.analysis.model.plectrum"
AUTO = "auto"
LEVELS = Registry(
    "sautereau.plectrum_levels",
    "plectrum level",
    {
        AUTO: f"{_HERE}.levels:automatic",
        "elastica": f"{_HERE}.elastica:Elastica",
        "fe": f"{_HERE}.fe.level:FE",
        "rods": f"{_HERE}.rods:Rods",
        "beam": f"{_HERE}.beam:Beam",
        "two-beam": f"{_HERE}.beam:TwoBeam",
    },
    ModelError,
)  # Functions of a `Plectrum` that return a `PlectrumMap`; the default first


def level_of(plectrum: "Plectrum", level: str = AUTO) -> str:
    """Return the name of a level; of `auto` the cheapest that represents all that is described.

    `elastica` has the stiffness of an outline everywhere, but neither shear nor the corners of a
    step, where the material carries no stress: 0.3 to 4 % of the force (docs/model.md).
    """
    if level != AUTO:
        return level
    return "fe" if plectrum.described else "elastica"


def dropped(plectrum: "Plectrum", level: str) -> tuple[str, ...]:
    """Return the fields of a plectrum that a level ignores."""
    if not plectrum.described:
        return ()
    represented = getattr(LEVELS.get(level_of(plectrum, level)), "represents", ())
    return tuple(field for field in plectrum.described if field not in represented)


def automatic(plectrum: "Plectrum") -> "PlectrumMap":
    """Return the map of a plectrum at the level of `level_of`."""
    return plectrum_map(plectrum, level_of(plectrum))


def plectrum_map(plectrum: "Plectrum", level: str) -> "PlectrumMap":
    """Return the map of a plectrum at a level.

    Raises:
        ModelError: There is no such level, or the plectrum is out of its range.
    """
    return LEVELS.get(level)(plectrum)


def levels_help() -> str:
    """Return the help text of an option that takes a level, with all registered names."""
    notes = {
        AUTO: " (default: elastica for a uniform section, fe for any other)",
        "fe": " (carved shape)",
    }
    return f"Plectrum bending model: {', '.join(n + notes.get(n, '') for n in LEVELS.names())}."
