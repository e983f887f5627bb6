"""The transient phase of a press: its damped modes, and to which part of the bench they belong."""

from sautereau.analysis.transient.attribute import Attributed, Source, attribute
from sautereau.analysis.transient.combine import Oscillation, combine
from sautereau.analysis.transient.evidence import Examined, Observed, examine

__all__ = [
    "Attributed",
    "Examined",
    "Observed",
    "Oscillation",
    "Source",
    "attribute",
    "combine",
    "examine",
]
