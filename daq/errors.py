"""What goes wrong between the terminal block and the file."""

from sautereau.rig.errors import SautereauError


class DaqError(SautereauError):
    """A fault of the acquisition; the message says who, the value, the limit, the remedy."""


class RecordingError(DaqError):
    """A recording that cannot be written or read."""
