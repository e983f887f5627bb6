"""Base classes of all errors that sautereau raises."""


class SautereauError(Exception):
    """An error whose message says who, the value, the limit and how to fix it."""


class UsageError(SautereauError):
    """A wrong value of a command's option; the command ends with status 2."""


class RigError(SautereauError):
    """A rig file that cannot be used; the message lists all its faults."""
