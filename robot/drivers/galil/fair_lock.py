"""A lock for the line, shared by the commands of the host and by its keep-alive."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from sautereau.robot.errors import SilentController


class FairLock:
    """One thread at a time; a command that waits ends the keep-alive's wait for an answer."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        """Held by the thread that uses the line."""
        self._command_waits = threading.Event()
        self._silent: SilentController | None = None

    @property
    def command_waits(self) -> bool:
        """Whether a command waits for the lock."""
        return self._command_waits.is_set()

    @contextmanager
    def keep_alive(self) -> Iterator[None]:
        """Hold the lock; a silent controller found in the block is reported to the next command."""
        with self.lock:
            try:
                yield
            except SilentController as error:
                self._silent = error
                raise

    @contextmanager
    def command(self) -> Iterator[None]:
        """Hold the lock, taken from a waiting keep-alive.

        Raises:
            SilentController: The keep-alive found it so, and no command was sent since.
        """
        with self.command_despite_silence() as error:
            if error is not None:
                raise error
            yield

    @contextmanager
    def command_despite_silence(self) -> Iterator[SilentController | None]:
        """Hold the lock as `command` does; yield the keep-alive's error instead of raising it."""
        self._command_waits.set()
        with self.lock:
            self._command_waits.clear()
            error, self._silent = self._silent, None
            yield error
