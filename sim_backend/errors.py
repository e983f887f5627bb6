"""Errors of scenes and of the stand-in."""

from sautereau.rig.errors import SautereauError


class SceneError(SautereauError):
    """A scene that cannot be simulated; the message lists every fault in it."""
