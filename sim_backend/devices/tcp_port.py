"""The Ethernet port of an emulated controller: TCP on loopback, one handle per connection."""

import contextlib
import select
import socket
from typing import Protocol

from sautereau.sim_backend.devices.serial_port import Port, PortGone

_CHUNK = 4096


class Controller(Protocol):
    """The controller behind the port; the bench implements it."""

    def connect(self) -> str | None:
        """Open a connection; return its handle, or None if all are in use."""
        ...

    def connected(self, port: str) -> bool:
        """Return whether the controller still has a handle."""
        ...

    def disconnect(self, port: str) -> None:
        """Lose a connection."""
        ...

    def receive(self, data: bytes, port: str) -> bytes:
        """Take bytes from a handle and return the answer; see `serial_port.Handler`."""
        ...


class TcpPort(Port):
    """A TCP port on loopback, for several hosts or connections at a time.

    Args:
        controller: Answers them.
    """

    def __init__(self, controller: Controller) -> None:
        super().__init__()
        self._controller = controller
        self._connections: dict[socket.socket, tuple[str, bytearray]] = {}

    def _open(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"tcp://127.0.0.1:{self._listener.getsockname()[1]}"

    def _close(self) -> None:
        for connection in self._connections:
            connection.close()
        self._connections.clear()
        self._listener.close()

    def _serve(self) -> None:
        while True:
            connections = self._connections
            writers = [each for each, (_, answers) in connections.items() if answers]
            sources = [self._listener, self._wake, *connections]
            readable, writable, _ = select.select(sources, writers, [])
            if self._stopping:
                return
            if self._wake in readable:
                self._wake.recv(_CHUNK)
                for handle, answers in connections.values():
                    answers += self._controller.receive(b"", handle)
            if self._listener in readable:
                self._accept()
            for connection in [each for each in connections if each in readable]:
                self._read(connection)
            for connection in [each for each in writable if each in connections]:
                _, answers = connections[connection]
                with contextlib.suppress(BlockingIOError, ConnectionError):
                    del answers[: connection.send(answers[:_CHUNK])]

    def _accept(self) -> None:
        connection, _ = self._listener.accept()
        handle = self._controller.connect()
        if handle is None:
            connection.close()
            return
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._connections[connection] = handle, bytearray()

    def _read(self, connection: socket.socket) -> None:
        handle, answers = self._connections[connection]
        data = b""
        with contextlib.suppress(BlockingIOError, ConnectionError):
            data = connection.recv(_CHUNK)
            if data:
                with contextlib.suppress(PortGone):
                    answers += self._controller.receive(data, handle)
                    if self._controller.connected(handle):
                        return
        self._controller.disconnect(handle)
        connection.close()
        del self._connections[connection]
