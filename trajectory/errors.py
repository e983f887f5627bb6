"""Faults of a plan."""

from rig.errors import SautereauError


class TrajectoryError(SautereauError):
    """A press that cannot be planned; the message lists everything that fails."""
