"""Open a serial port, or list the ports of this machine and how to fix it."""

import errno
from typing import Protocol

from sautereau.robot.errors import PortUnavailable


class Port(Protocol):
    """The part of a serial port that a request/answer line uses."""

    @property
    def in_waiting(self) -> int:
        """Bytes that can be read without waiting."""
        ...

    def read(self, size: int, /) -> bytes | None:
        """Return up to ``size`` bytes; none after the port's timeout."""
        ...

    def write(self, data: bytes, /) -> int | None:
        """Send all bytes."""
        ...

    def reset_input_buffer(self) -> None:
        """Discard what has come in."""
        ...

    def close(self) -> None:
        """Release the port."""
        ...


def open_port(name: str, baud_rate: int, timeout: float) -> Port:
    """Open a serial device, or any URL that pyserial takes, for exclusive use.

    Args:
        name: Device or URL.
        baud_rate: Bits per second.
        timeout: s, of reading and of writing.

    Raises:
        PortUnavailable: Names the port, the reason, how to fix it and the ports of this machine.
    """
    import serial

    try:
        return serial.serial_for_url(
            name, baudrate=baud_rate, timeout=timeout, write_timeout=timeout, exclusive=True
        )
    except (OSError, ValueError) as error:  # SerialException is an OSError
        raise PortUnavailable(
            f"port {name}: cannot be opened: {error}; {_fix(error)}; {_ports()}"
        ) from error


def port_errors() -> tuple[type[Exception], ...]:
    """Return the errors that pyserial raises for a port that has gone away."""
    try:
        import termios
    except ImportError:  # Windows
        return (OSError,)
    return (OSError, termios.error)


def _fix(error: Exception) -> str:
    number = getattr(error, "errno", None)
    text = str(error).lower()
    if number in (errno.EACCES, errno.EPERM) or "access is denied" in text:
        return (
            "you have no permission: add yourself to its group (often dialout), then log in again"
        )
    if number in (errno.EBUSY, errno.EAGAIN) or "lock" in text:
        return "another program uses it: end that program"
    return "plug the controller in and switch it on, or correct controller.port in the rig file"


def _ports() -> str:
    from serial.tools import list_ports

    found = sorted(port.device for port in list_ports.comports())
    return f"ports of this machine: {', '.join(found) or 'none'}"
