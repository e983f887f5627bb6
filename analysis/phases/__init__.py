"""The phases of a press: free, string held, string released, for every string."""

from sautereau.analysis.phases.find import find_phases
from sautereau.analysis.phases.found import HeldString, Phases

__all__ = ["HeldString", "Phases", "find_phases"]
