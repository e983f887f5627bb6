"""Faults of models and analyses."""

from sautereau.rig.errors import SautereauError


class AnalysisError(SautereauError):
    """A recording or a comparison that gives no answer; says why and what to do."""


class ModelError(SautereauError):
    """A model outside the range in which it has a solution; says which quantity, and the range."""
