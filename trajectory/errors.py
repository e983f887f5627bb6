"""Faults of a plan."""

from sautereau.rig.errors import SautereauError


class TrajectoryError(SautereauError):
    """A press cannot be planned; the message lists all reasons."""
