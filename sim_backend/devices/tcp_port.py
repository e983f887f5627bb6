"""The Ethernet port of an emulated controller: TCP on loopback, one handle per connection."""

import contextlib
import socket

from sautereau.sim_backend.devices.emulators import Handles
from sautereau.sim_backend.devices.serial_port import (
    MOST_UNREAD,
    PortGone,
    SocketPort,
    accepted,
    ready,
)

_CHUNK = 4096


class TcpPort(SocketPort):
    """A TCP port on loopback, for several hosts or connections at a time."""

    scheme = "tcp"

    def __init__(self, controller: Handles) -> None:
        super().__init__()
        self._controller = controller
        self._connections: dict[socket.socket, tuple[str, bytearray]] = {}

    def _close(self) -> None:
        for connection in self._connections:
            connection.close()
        self._connections.clear()
        super()._close()

    def _serve(self) -> None:
        while True:
            connections = self._connections
            writers = [each for each, (_, answers) in connections.items() if answers]
            listening = [c for c, (_, answers) in connections.items() if len(answers) < MOST_UNREAD]
            sources = [self._listener, self._wake, *listening]
            readable, writable = ready(sources, writers)
            if self._stopping:
                return
            if self._wake in readable:
                self._wake.recv(_CHUNK)
                for handle, answers in connections.values():
                    more = self._controller.receive(b"", handle)
                    answers += more[: max(0, MOST_UNREAD - len(answers))]
            if self._listener in readable:
                self._accept()
            for connection in [each for each in connections if each in readable]:
                self._read(connection)
            for connection in [each for each in writable if each in connections]:
                _, answers = connections[connection]
                with contextlib.suppress(BlockingIOError, ConnectionError):
                    del answers[: connection.send(answers[:_CHUNK])]

    def _accept(self) -> None:
        connection = accepted(self._listener)
        if connection is None:
            return
        handle = None
        with contextlib.suppress(OSError):  # it may be gone already
            handle = self._controller.connect(connection.getpeername()[1])
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
