"""The transient phase of a press: its damped modes, and to which part of the bench they belong."""

from sautereau.analysis.transient.attribute import Attributed, Source, attribute
from sautereau.analysis.transient.evidence import (
    Examined,
    ObservedMode,
    Oscillation,
    combine,
    examine,
)

__all__ = [
    "Attributed",
    "Examined",
    "ObservedMode",
    "Oscillation",
    "Source",
    "attribute",
    "combine",
    "examine",
]
