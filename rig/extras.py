"""Packages that only some uses need: the extras of the installation."""

from importlib.util import find_spec

from sautereau.rig.errors import SautereauError


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
