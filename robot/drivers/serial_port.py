"""Open a serial port, or say which ports there are and what to do."""

import errno
from typing import Protocol

from sautereau.robot.errors import PortUnavailable


class Port(Protocol):
    """What a request/answer line needs of a serial port."""

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
        """Forget what has come in."""
        ...

    def close(self) -> None:
        """Give the port back."""
        ...


def open_port(name: str, baud_rate: int, timeout: float) -> Port:
    """Open a serial device, or any URL that pyserial takes, for this program alone.

    Args:
        name: Device or URL.
        baud_rate: Bits a second.
        timeout: s, of reading and of writing.

    Raises:
        PortUnavailable: Names the port, the reason, the ports there are and the remedy.
    """
    import serial

    try:
        return serial.serial_for_url(
            name, baudrate=baud_rate, timeout=timeout, write_timeout=timeout, exclusive=True
        )
    except (OSError, ValueError) as error:  # SerialException is an OSError
        raise PortUnavailable(
            f"port {name}: cannot be opened: {error}; {_remedy(error)}; {_ports()}"
        ) from error


def port_errors() -> tuple[type[Exception], ...]:
    """Return what pyserial raises where a port has gone away."""
    try:
        import termios
    except ImportError:  # Windows
        return (OSError,)
    return (OSError, termios.error)


def _remedy(error: Exception) -> str:
    number = getattr(error, "errno", None)
    text = str(error).lower()
    if number in (errno.EACCES, errno.EPERM) or "access is denied" in text:
        return "you may not use it: add yourself to its group (often dialout), then log in again"
    if number in (errno.EBUSY, errno.EAGAIN) or "lock" in text:
        return "another program uses it: end that program"
    return "plug the controller in and switch it on, or correct controller.port in the rig file"


def _ports() -> str:
    from serial.tools import list_ports

    found = sorted(port.device for port in list_ports.comports())
    return f"ports of this machine: {', '.join(found) or 'none'}"
