"""The transient phase of a press: its damped modes, and to which part of the bench they belong."""

from sautereau.analysis.transient.attribute import Attributed, attribute
from sautereau.analysis.transient.combine import Oscillation, combine
from sautereau.analysis.transient.evidence import Examined, ObservedMode, examine
from sautereau.analysis.transient.sources import Source

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
