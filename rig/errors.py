"""Base classes of all errors that sautereau raises, and the error of a missing extra."""

from importlib.util import find_spec


class SautereauError(Exception):
    """An error whose message says who, the value, the limit and how to fix it."""


class UsageError(SautereauError):
    """A wrong value of a command's option; the command ends with status 2."""


class RigError(SautereauError):
    """A rig file that cannot be used; the message lists all its faults."""


class MissingExtraError(SautereauError):
    """A package of an extra is not installed; the message says how to install it."""


def require(extra: str, what: str, *modules: str) -> None:
    """Refuse a use whose packages are not installed.

    Raises:
        MissingExtraError: Names what is missing, and the command that installs it.
    """
    missing = [name for name in modules if find_spec(name) is None]
    if missing:
        raise MissingExtraError(
            f"{what}: not installed: {', '.join(missing)}; install with"
            f" `python -m pip install 'sautereau[{extra}]'`"
        )
