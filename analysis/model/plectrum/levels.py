"""The levels of the plectrum by name; a level's file is imported when it is asked for."""

from collections.abc import Callable

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import PlectrumMap
from sautereau.rig.instrument import Plectrum


def plectrum_map(plectrum: Plectrum, level: str) -> PlectrumMap:
    """Return the map of a plectrum at a level.

    Args:
        plectrum: Of the rig; its friction goes into the map.
        level: A name of `LEVELS`.

    Raises:
        ModelError: There is no such level, or the plectrum is out of its range.
    """
    if level not in LEVELS:
        raise ModelError(f"level {level!r} is not known; take one of {', '.join(LEVELS)}")
    return LEVELS[level](plectrum)


def _elastica(plectrum: Plectrum) -> PlectrumMap:
    from sautereau.analysis.model.plectrum.elastica import Elastica

    return Elastica(plectrum)


def _rods(plectrum: Plectrum) -> PlectrumMap:
    from sautereau.analysis.model.plectrum.rods import Rods

    return Rods(plectrum)


def _beam(plectrum: Plectrum) -> PlectrumMap:
    from sautereau.analysis.model.plectrum.beam import Beam

    return Beam(plectrum)


def _two_beam(plectrum: Plectrum) -> PlectrumMap:
    from sautereau.analysis.model.plectrum.two_beam import TwoBeam

    return TwoBeam(plectrum)


def _fe(plectrum: Plectrum) -> PlectrumMap:
    from sautereau.analysis.model.plectrum.fe.level import FE

    return FE(plectrum)


LEVELS: dict[str, Callable[[Plectrum], PlectrumMap]] = {
    "elastica": _elastica,
    "rods": _rods,
    "beam": _beam,
    "two-beam": _two_beam,
    "fe": _fe,
}
"""Constructors of the plectrum's map by the level's name; the default first."""
