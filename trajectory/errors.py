"""Faults of a plan."""

from sautereau.rig.errors import SautereauError


class TrajectoryError(SautereauError):
    """A press that cannot be planned; the message lists everything that fails."""
