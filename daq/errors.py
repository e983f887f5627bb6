"""Errors between the terminal block and the file."""

from sautereau.rig.errors import SautereauError


class DaqError(SautereauError):
    """An error of the acquisition; the message gives value, limit and how to fix it."""


class RecordingError(DaqError):
    """An error in writing or reading a recording."""
