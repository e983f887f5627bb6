"""The port of a controller on Ethernet: one TCP connection, read and written like a serial port."""

import select
import socket
from urllib.parse import urlsplit

TCP = "tcp://"  # Begins the name of such a port: `tcp://192.168.1.3:23`
_CHUNK = 1 << 16


class EthernetPort:
    """A connection to a controller; a closed or broken one raises `OSError` at the next use.

    Args:
        name: `tcp://host:port`.
        timeout: s, of connecting, of reading and of writing.

    Raises:
        OSError: The controller cannot be reached.
        ValueError: The name has no host or no port.
    """

    def __init__(self, name: str, timeout: float):
        parts = urlsplit(name)
        if not parts.hostname or not parts.port:
            raise ValueError("write it as tcp://host:port, such as tcp://192.168.1.3:23")
        self._socket = socket.create_connection((parts.hostname, parts.port), timeout)
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
        """Return up to ``size`` bytes, at least one unless none comes within the timeout."""
        if not self._received:
            try:
                self._receive()
            except TimeoutError:
                return b""
        data = bytes(self._received[:size])
        del self._received[:size]
        return data

    def write(self, data: bytes, /) -> int:
        """Send all bytes."""
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
        data = self._socket.recv(_CHUNK)
        if not data:
            raise ConnectionError("the controller closed the connection")
        self._received += data
