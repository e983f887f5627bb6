"""Reading and closing a serial port, for the lines of all controllers."""

from collections.abc import Iterator
from contextlib import contextmanager

from sautereau.robot.drivers.serial_port import Port, port_errors
from sautereau.robot.errors import LineLost, SilentController


class Wire:
    """Bytes to a controller and from it.

    Args:
        port: An open serial port, whose reads end after its timeout.
        name: Of the port, for messages.
        timeout: s, of one read, for messages.
    """

    def __init__(self, port: Port, name: str, timeout: float):
        self.name, self.timeout = name, timeout
        self._port, self._gone = port, port_errors()

    def close(self) -> None:
        """Close the port; a port that has gone away counts as closed."""
        try:
            self._port.close()
        except self._gone:  # nothing is left to close
            return

    @contextmanager
    def _reaching(self, asked: str) -> Iterator[None]:
        """Report a port that goes away in the block as lost, with what was asked."""
        try:
            yield
        except self._gone as error:
            raise LineLost(
                f"connection to the controller on {self.name} lost at {asked!r}: {error}; check"
                " the cable, the adapter and the controller's power, then connect() and home()"
                " again"
            ) from error

    def _waiting(self) -> bytes:
        """Return what has come in already."""
        count = self._port.in_waiting
        return (self._port.read(count) or b"") if count else b""

    def _read(self) -> bytes:
        """Return at least one byte, or none after the port's timeout."""
        return self._port.read(max(1, self._port.in_waiting)) or b""

    def _silence(self, asked: str, so_far: str) -> SilentController:
        """Return the error of a controller that does not answer; ``so_far`` is what came in."""
        return SilentController(
            f"controller on {self.name} did not answer {asked!r} within"
            f" {self.timeout:g} s{f' after {so_far}' if so_far else ''}; check its power, the"
            " cable, that controller.port is its port and controller.baud_rate its baud rate"
        )
