"""A lock by which the commands of the host and its keep-alive take turns on the line."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from sautereau.robot.errors import RobotError, SilentController

_LONGEST_TURN = 1.0  # s, that a thread waits for its turn before it takes the lock out of turn


class FairLock:
    """A lock for the commands of the host and its keep-alive: one thread at a time, in turn.

    A thread that waits gets the lock before the one that has just released it. A command that
    waits ends the keep-alive's wait for an answer.
    """

    def __init__(self) -> None:
        # The same thread may take both again: an interrupt may have left them taken.
        self._lock = threading.RLock()
        self._turn = threading.RLock()
        """Held by the one thread that is next."""
        self._command_waits = threading.Event()
        self._found: RobotError | None = None

    @property
    def command_waits(self) -> bool:
        """Whether a command waits for the lock."""
        return self._command_waits.is_set()

    @contextmanager
    def held(self) -> Iterator[None]:
        """Hold the lock."""
        in_turn = self._turn.acquire(timeout=_LONGEST_TURN)
        try:
            self._lock.acquire()
        finally:
            if in_turn:
                self._turn.release()
        try:
            yield
        finally:
            self._lock.release()

    @contextmanager
    def keep_alive(self) -> Iterator[None]:
        """Hold the lock; a silent controller found in the block is reported to the next command."""
        with self.held():
            try:
                yield
            except SilentController as error:
                self.report(error)
                raise

    def report(self, error: RobotError) -> None:
        """Raise an error, found by the keep-alive, at the next command."""
        self._found = error

    @contextmanager
    def command(self) -> Iterator[None]:
        """Hold the lock, taken from a waiting keep-alive.

        Raises:
            RobotError: The keep-alive found it, and no command was sent since.
        """
        with self.command_despite_silence() as error:
            if error is not None:
                raise error
            yield

    @contextmanager
    def command_despite_silence(self) -> Iterator[RobotError | None]:
        """Hold the lock as `command` does; yield the keep-alive's error instead of raising it."""
        self._command_waits.set()
        with self.held():
            self._command_waits.clear()
            error, self._found = self._found, None
            yield error
