"""Errors as the driver answers them."""


class DaqmxError(Exception):
    """An error as the driver answers it: its code and text."""

    def __init__(self, code: int, message: str):
        super().__init__(message)
        self.code = code
        self.samples_read: int | None = None
        """Samples of each channel that a failed read returned; None where nothing was read."""


def error_text(code: int) -> str:
    """Return what an error code means, from the name that the client's library gives it."""
    from nidaqmx.error_codes import DAQmxErrors  # slow, and this file is imported with every card

    try:
        return DAQmxErrors(code).name.replace("_", " ").capitalize() + "."
    except ValueError:
        return "Error code could not be found."
