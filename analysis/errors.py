"""Errors of models and analyses."""

from sautereau.rig.errors import SautereauError


class AnalysisError(SautereauError):
    """A recording or a comparison without a result; the message says why and how to fix it."""


class MissingSignalError(AnalysisError):
    """A recording of the force alone or of the velocity alone, where both are needed."""


class ModelError(SautereauError):
    """A model outside its range of solutions; the message names the quantity and the range."""
