"""The base of every error that sautereau raises on purpose."""


class SautereauError(Exception):
    """A fault whose message says who, the value, the limit and the remedy."""


class RigError(SautereauError):
    """A rig file that cannot be used; the message lists every fault in it."""
