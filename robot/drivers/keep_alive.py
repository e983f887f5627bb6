"""The keep-alive of the controller's watchdog, and the lock by which it shares the line."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Self

from sautereau.rig.schema import Controller
from sautereau.robot.errors import RobotError, SilentController

TICKS = 10  # Parts of the watchdog's period, each of which the controller counts down
_RENEWALS = 4  # Renewals in a period of the watchdog, so that one may be lost


def first_wait(controller: Controller) -> float:
    """Return how long [s] a question waits for its answer before it is asked once more.

    It is one interval of the keep-alive, which waits meanwhile: the watchdog has not run out then.
    """
    return controller.watchdog_period / _RENEWALS


class KeepAlive:
    """A context manager that renews the watchdog while the thread that entered it is alive.

    A separate thread renews it, also while the host is busy. The renewals end with the process or
    with that thread, and while the process is stopped.

    Args:
        renew: Renews the watchdog once; its argument returns whether to continue to wait for the
            controller's answer.
        period: Period of the watchdog, s.
    """

    def __init__(self, renew: Callable[[Callable[[], bool]], None], period: float):
        self._renew, self._interval = renew, period / _RENEWALS
        self._over = threading.Event()

    def __enter__(self) -> Self:
        self._owner = threading.current_thread()
        self._thread = threading.Thread(target=self._run, name="watchdog keep-alive", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._over.wait(self._interval) and self._owner.is_alive():
            try:
                self._renew(lambda: not self._over.is_set())
            except RobotError:  # the next may arrive; if none does, the watchdog trips
                continue


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
        in_turn = self._turn.acquire(timeout=1.0)  # s; then out of turn
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
