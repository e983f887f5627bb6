"""Live views of a running session: in the terminal, and in Foxglove."""

from sautereau.rig.errors import SautereauError

LOOPBACK = "127.0.0.1"


class LiveError(SautereauError):
    """A live view cannot be shown; the message says why, and how to fix it."""
