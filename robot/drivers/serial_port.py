"""Open a port of a controller, or list the ports of this machine and how to fix it."""

import errno
import logging
import math
import select
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Protocol, TypeVar
from urllib.parse import urlsplit

from sautereau.rig.disk import read_limited
from sautereau.rig.lock import held_device
from sautereau.robot.errors import (
    GarbledAnswer,
    LineLost,
    PortUnavailable,
    SilentController,
    UnaskedText,
)

T = TypeVar("T")
_LOG = logging.getLogger(__name__)
SCHEMES = ("socket", "rfc2217", "loop")
"""Accepted schemes of pyserial's URLs: ports behind a network, and one that only echoes."""


_NO_DEVICE = "loop:"
_WAIT = 0.025  # s, longest that one read of a port waits: a line counts such waits


class Port(Protocol):
    """The part of a serial port that a request/answer line uses."""

    @property
    def in_waiting(self) -> int:
        """Bytes that can be read without waiting."""
        ...

    def read(self, size: int, /) -> bytes | None:
        """Return up to ``size`` bytes; none if none comes within the port's timeout, or less."""
        ...

    def write(self, data: bytes, /) -> int | None:
        """Send all bytes."""
        ...

    def reset_input_buffer(self) -> None:
        """Discard the bytes received so far."""

    def close(self) -> None:
        """Release the port."""


class _OpenPort:
    """An open port, which logs its traffic, and keeps other processes out until it is closed."""

    def __init__(self, port: Port, name: str, held: ExitStack):
        self._port, self._name, self._held = port, name, held

    @property
    def in_waiting(self) -> int:
        return self._port.in_waiting

    def read(self, size: int, /) -> bytes | None:
        data = self._port.read(size)
        if data:
            _LOG.debug("%s received %r", self._name, data)
        return data

    def write(self, data: bytes, /) -> int | None:
        _LOG.debug("%s sent %r", self._name, data)
        return self._port.write(data)

    def reset_input_buffer(self) -> None:
        _LOG.debug("%s discards what has come in", self._name)
        self._port.reset_input_buffer()

    def close(self) -> None:
        _LOG.debug("%s closes", self._name)
        with self._held:
            self._port.close()


@contextmanager
def hold_port(name: str, purpose: str, *, shared: bool = False) -> Iterator[None]:
    """Keep other processes of this machine from a port; see `sautereau.rig.lock.locked`.

    Raises:
        PortUnavailable: Another process or thread uses it; the message names it.
    """
    if name.startswith(_NO_DEVICE):
        yield
        return
    with held_device(PortUnavailable, f"port {name}", purpose, "port", name, shared=shared):
        yield


def open_port(name: str, baud_rate: int, timeout: float) -> Port:
    """Open a serial device, or a port on the network, for exclusive use.

    Of the programs of this user, sautereau keeps out those that use this function; a serial port
    is locked by the operating system as well.

    All traffic is logged at the level `debug`.

    Args:
        name: Device, `tcp://host:port`, or a pyserial URL of `SCHEMES`; others of its URLs
            write files or imitate a port.
        baud_rate: Bits per second.
        timeout: s, of writing; reading waits for `_WAIT` at most.

    Raises:
        PortUnavailable: Names the port, the reason, how to fix it and the ports of this machine.
    """
    held = ExitStack()
    held.enter_context(hold_port(name, "a connection"))
    try:
        port = _opened(name, baud_rate, timeout)
    except (OSError, ValueError) as error:  # SerialException is an OSError
        held.close()
        raise PortUnavailable(
            f"port {name}: cannot be opened: {_reason(error)}; {_fix(error)}; ports of this"
            f" machine: {', '.join(machine_ports()) or 'none'}"
        ) from error
    return _OpenPort(port, name, held)


def _opened(name: str, baud_rate: int, timeout: float) -> Port:
    import serial

    if name.startswith(TCP):
        return EthernetPort(name, timeout)
    scheme, separator, _ = name.partition("://")
    if separator and scheme not in SCHEMES:
        raise ValueError(f"{scheme}:// is not one of tcp, {', '.join(SCHEMES)}")
    try:
        port = serial.serial_for_url(
            name,
            baudrate=baud_rate,
            timeout=min(timeout, _WAIT),
            write_timeout=timeout,
            exclusive=True,
        )
    except KeyError as error:  # loop:// raises it for an option that it does not know
        raise ValueError(f"{name.partition('?')[2]!r} is not an option of {scheme}://") from error
    # A USB adapter collects bytes for up to 16 ms, unless the system has this mode (Linux).
    with suppress(AttributeError, ValueError):
        port.set_low_latency_mode(True)
    return port


def latency(name: str, devices: Path = Path("/sys/bus/usb-serial/devices")) -> float | None:
    """Return how long the USB adapter of a port collects bytes, s; None where it is unknown.

    In low-latency mode, while a port is open, the driver of FTDI's adapters uses 1 ms instead.
    """
    timer = devices / Path(name).resolve().name / "latency_timer"
    try:
        return float(read_limited(timer)) * 1e-3
    except (OSError, ValueError):
        return None


def port_errors() -> tuple[type[Exception], ...]:
    """Return the errors that pyserial raises for a port that has gone away."""
    try:
        import termios
    except ImportError:  # Windows
        return (OSError,)
    return (OSError, termios.error)


def _reason(error: Exception) -> str:
    """Return the system's text; pyserial's own text names the port and repeats the error."""
    both = (each for each in (error.__context__, error) if isinstance(each, OSError))
    return next((each.strerror for each in both if (each.errno or 0) > 0), None) or str(error)


def _fix(error: Exception) -> str:
    number = getattr(error, "errno", None)
    text = str(error).lower()
    if number in (errno.EACCES, errno.EPERM):
        return (
            "you have no permission: add yourself to its group (often dialout), then log in again"
        )
    # Windows denies access to a port that is open.
    if number in (errno.EBUSY, errno.EAGAIN) or "lock" in text or "access is denied" in text:
        return "another program uses it: end that program"
    if number == errno.ECONNREFUSED:
        return f"correct controller.port in the rig file; if it is right, {_TAKEN}"
    return "plug the controller in and switch it on, or correct controller.port in the rig file"


def machine_ports() -> list[str]:
    """Return the names of this machine's serial ports, sorted."""
    from serial.tools import list_ports

    return sorted(port.device for port in list_ports.comports())


class Wire:
    """Sends bytes to a controller, and receives bytes from it.

    Args:
        timeout: s, longest wait for the next bytes of an answer.
        first_wait: s, the same in the first attempt of `reading`; None for ``timeout``.
    """

    def __init__(self, port: Port, name: str, timeout: float, first_wait: float | None = None):
        self.name, self.timeout = name, timeout
        self._port, self._gone = port, port_errors()
        self._patience = timeout
        self._first_wait = min(timeout, first_wait or timeout)

    def close(self) -> None:
        """Close the port; a port that has disappeared counts as closed."""
        try:
            self._port.close()
        except self._gone:  # nothing is left to close
            return

    @contextmanager
    def _reaching(self, asked: str) -> Iterator[None]:
        """Report a port that disappears inside the context as lost, with the command sent."""
        try:
            yield
        except self._gone as error:
            fix = (
                _TAKEN
                if isinstance(error, _ClosedUnheardError)
                else "check the cable, the adapter and the controller's power, then connect() and"
                " home() again"
            )
            raise LineLost(
                f"connection to the controller on {self.name} lost at {asked!r}: {error}; {fix}"
            ) from error

    def reading(self, read: Callable[[], T]) -> T:
        """Call ``read``, and once more on a fresh line if an answer is lost, spoilt or unreadable.

        Args:
            read: Asks for values, and returns them. It must not move, set or clear anything.

        Raises:
            RobotError: Of the second attempt; `UnaskedText` of the first.
        """
        with self._alone():
            try:
                self._patience = self._first_wait
                return read()
            except UnaskedText:
                raise
            except (GarbledAnswer, SilentController) as error:
                self._patience = self.timeout
                _LOG.warning("%s. It is asked once more", error)
                try:
                    self._freshen()
                except SilentController:
                    raise error from None
                return read()
            finally:
                self._patience = self.timeout

    def _alone(self) -> AbstractContextManager[object]:
        """Keep the other threads off the line, for more than one exchange."""
        return nullcontext()

    def _freshen(self) -> None:
        """Discard everything that an earlier question may still be answered with."""
        with self._reaching("reset"):
            self._port.reset_input_buffer()

    def _waiting(self) -> bytes:
        """Return the bytes received so far."""
        count = self._port.in_waiting
        return (self._port.read(count) or b"") if count else b""

    def _read(self) -> bytes:
        """Return at least one byte, or none after the timeout."""
        patience = self._patience
        data, end = None, time.perf_counter() + patience
        for _ in range(math.ceil(patience / _WAIT) or 1):
            data = self._port.read(max(1, self._port.in_waiting))
            if data or time.perf_counter() > end:
                break
        return data or b""

    def _silence(self, asked: str, so_far: str) -> SilentController:
        """Return the error of a controller that does not answer; ``so_far`` was received."""
        return SilentController(
            f"controller on {self.name} did not answer {asked!r} within"
            f" {self._patience:g} s{f' after {so_far}' if so_far else ''}; check its power, the"
            " cable, that controller.port is its port and controller.baud_rate its baud rate"
        )


_TAKEN = (
    "all its connections are probably in use (a Galil has eight Ethernet handles): end the other"
    " programs that are connected to it, or switch the controller off and on, then connect() again"
)


class _ClosedUnheardError(ConnectionError):
    """The controller closed a connection on which it has never answered."""


TCP = "tcp://"  # Begins the name of such a port: `tcp://192.168.1.3:23`


class EthernetPort:
    """A connection to a controller; a closed or broken one raises `OSError` at the next use.

    Args:
        name: `tcp://host:port`.
        timeout: s, of connecting and of writing; reading waits for `_WAIT` at most.

    Raises:
        OSError: The controller cannot be reached.
        ValueError: The name has no host or no port.
    """

    def __init__(self, name: str, timeout: float):
        parts = urlsplit(name)
        if not parts.hostname or not parts.port:
            raise ValueError("write it as tcp://host:port, such as tcp://192.168.1.3:23")
        self._socket = socket.create_connection((parts.hostname, parts.port), timeout)
        self._wait = min(timeout, _WAIT)
        self._heard = False
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        self._received = bytearray()

    @property
    def in_waiting(self) -> int:
        """Bytes that can be read without waiting."""
        while select.select([self._socket], [], [], 0)[0]:
            self._receive()
        return len(self._received)

    def read(self, size: int, /) -> bytes:
        """Return up to ``size`` bytes, at least one unless none comes in time."""
        if not self._received and select.select([self._socket], [], [], self._wait)[0]:
            self._receive()
        data = bytes(self._received[:size])
        del self._received[:size]
        return data

    def write(self, data: bytes, /) -> int:
        """Send all bytes."""
        with self._closing():
            self._socket.sendall(data)
        return len(data)

    def reset_input_buffer(self) -> None:
        """Discard the bytes received so far."""
        if self.in_waiting:
            self._received.clear()

    def close(self) -> None:
        """End the connection."""
        self._socket.close()

    def _receive(self) -> None:
        with self._closing():
            data = self._socket.recv(1 << 16)
            if not data:
                raise ConnectionError("the controller closed the connection")
        self._heard = True
        self._received += data

    @contextmanager
    def _closing(self) -> Iterator[None]:
        """Distinguish a connection that the controller has closed without having answered."""
        try:
            yield
        except ConnectionError as error:
            if self._heard:
                raise
            raise _ClosedUnheardError("the controller closed it before its first answer") from error
