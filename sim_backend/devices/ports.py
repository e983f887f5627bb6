"""Lines to the stand-in: a pseudo-terminal, a socket on loopback, or the controller's Ethernet.

Each is a context manager with a `url` that the host opens, and a thread that passes the received
bytes to the controller and sends back its answer.
"""

import contextlib
import os
import select
import socket
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Self

from sautereau.sim_backend.devices.emulators import Handles

Handler = Callable[[bytes], bytes]
"""Takes the received bytes and returns the answer; called in the port's thread. Without bytes it
returns what the device has sent by itself."""

_CHUNK = 4096
MOST_UNREAD = 1 << 20  # Bytes of answers that a host has not read, from which on its commands wait


class PortGone(Exception):  # noqa: N818 - the name says what happened
    """Raised by a handler whose line is gone for good: the port closes without an answer."""


End = socket.socket | int


def ready(readers: Sequence[End], writers: Sequence[End]) -> tuple[list[End], list[End]]:
    """Wait, and return what can be read and what can be written.

    `select` takes no descriptor above 1023, which a thousand connections to the card use up.
    """
    if not hasattr(select, "epoll"):  # not Linux
        readable, writable, _ = select.select(readers, writers, [])
        return readable, writable
    poll = select.poll()
    for end in {*readers, *writers}:
        poll.register(end, select.POLLIN * (end in readers) | select.POLLOUT * (end in writers))
    found = dict(poll.poll())

    def event(end: End) -> int:
        return found.get(end if isinstance(end, int) else end.fileno(), 0)

    gone = select.POLLHUP | select.POLLERR | select.POLLNVAL
    return (
        [end for end in readers if event(end) & (select.POLLIN | gone)],
        [end for end in writers if event(end) & (select.POLLOUT | gone)],
    )


def accepted(listener: socket.socket) -> socket.socket | None:
    """Accept a connection; None if it has gone, or the process has too many."""
    try:
        connection = listener.accept()[0]
    except OSError:
        time.sleep(0.05)  # s, as the process has no descriptor left
        return None
    connection.setblocking(False)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return connection


class Port(ABC):
    """The thread and its state: subclasses open, wait, read and write.

    Args:
        handler: Takes the received bytes, returns the answer.
    """

    def __init__(self, handler: Handler = bytes) -> None:
        self.url = ""
        """URL for pyserial; known once the port is entered."""
        self._handler = handler
        self._failure: Exception | None = None
        self._stopping = self._gone = False

    def __enter__(self) -> Self:
        self._failure, self._stopping, self._gone = None, False, False
        self._waker, self._wake = socket.socketpair()
        self._waker.setblocking(False)  # or a tick would wait for the thread that waits for it
        try:
            self._open()
        except BaseException:
            self._waker.close()
            self._wake.close()
            raise
        self._thread = threading.Thread(target=self._run, name=f"port {self.url}", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        """Close the line; bytes that the host has not read may be lost.

        Raises:
            Exception: The handler's, which ended the thread.
        """
        self._stopping = True
        self.wake()
        self._thread.join()
        if not self._gone:
            self._close()
        self._waker.close()
        self._wake.close()
        if self._failure is not None and kind is None:
            raise self._failure

    def wake(self) -> None:
        """Send the host what the device has sent by itself; any thread may call this."""
        with contextlib.suppress(OSError):  # the port is closing, or will wake already
            self._waker.send(b"w")

    def _run(self) -> None:
        try:
            self._serve()
        except PortGone:
            self._gone = True
            self._close()
        except Exception as error:  # noqa: BLE001 - raised by __exit__
            self._failure = error

    def _exchange(
        self,
        host: socket.socket | int,
        receive: Callable[[], bytes],
        send: Callable[[bytearray], int],
    ) -> None:
        """Answer one host, whose end does not block, until it or this port closes."""
        answers = bytearray()
        while True:
            readers = [host, self._wake] if len(answers) < MOST_UNREAD else [self._wake]
            readable, writable = ready(readers, [host] if answers else [])
            if self._stopping:
                return
            with contextlib.suppress(BlockingIOError):
                if self._wake in readable:
                    self._wake.recv(_CHUNK)
                    answers += self._handler(b"")[: max(0, MOST_UNREAD - len(answers))]
                if host in readable:
                    data = receive()
                    if not data:
                        return
                    answers += self._handler(data)
                if writable:
                    del answers[: send(answers[:_CHUNK])]

    @abstractmethod
    def _open(self) -> None:
        """Open the line and set its URL."""

    @abstractmethod
    def _close(self) -> None:
        """Close what `_open` has opened."""

    @abstractmethod
    def _serve(self) -> None:
        """Answer the hosts until the port closes."""


class PtyPort(Port):
    """A pseudo-terminal; the host may close it and open it again.

    Args:
        handler: Takes the received bytes, returns the answer.
    """

    def _open(self) -> None:
        import tty  # absent on Windows

        # The host's end stays open here too, for otherwise a host that closes it would hang up.
        self._ours, self._theirs = os.openpty()
        tty.setraw(self._theirs)
        os.set_blocking(self._ours, False)
        self.url = os.ttyname(self._theirs)

    def _close(self) -> None:
        os.close(self._ours)
        os.close(self._theirs)

    def _serve(self) -> None:
        ours = self._ours
        self._exchange(ours, lambda: os.read(ours, _CHUNK), lambda data: os.write(ours, data))


class SocketPort(Port):
    """A TCP port on loopback, for one host at a time.

    Args:
        handler: Takes the received bytes, returns the answer.
    """

    scheme = "socket"
    """Scheme of the URL."""

    def _open(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"{self.scheme}://127.0.0.1:{self._listener.getsockname()[1]}"

    def _close(self) -> None:
        self._listener.close()

    def _serve(self) -> None:
        while True:
            readable, _ = ready([self._listener, self._wake], [])
            if self._stopping:
                return
            if self._wake in readable:
                self._wake.recv(_CHUNK)
            if self._listener in readable:
                if (host := accepted(self._listener)) is None:
                    continue
                with host, contextlib.suppress(ConnectionError):
                    self._exchange(host, lambda host=host: host.recv(_CHUNK), host.send)
                if self._stopping:
                    return


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
