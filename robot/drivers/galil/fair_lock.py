"""Turns of threads at one line: who waits patiently gives way, and tells what it met."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from sautereau.robot.errors import SilentController


class Turns:
    """One thread at a time; urgent ones make a patient one end its waiting."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        """Held by the thread whose turn it is."""
        self._wanted = threading.Event()
        self._silent: SilentController | None = None

    @property
    def wanted(self) -> bool:
        """Whether an urgent thread waits."""
        return self._wanted.is_set()

    @contextmanager
    def patient(self) -> Iterator[None]:
        """Have the line to oneself; a silence met in the block is told the next urgent thread."""
        with self.lock:
            try:
                yield
            except SilentController as error:
                self._silent = error
                raise

    @contextmanager
    def urgent(self) -> Iterator[None]:
        """Have the line to oneself soon.

        Raises:
            SilentController: A patient thread met it, and nobody has had the line since.
        """
        with self.at_any_price() as error:
            if error is not None:
                raise error
            yield

    @contextmanager
    def at_any_price(self) -> Iterator[SilentController | None]:
        """Have the line to oneself soon; enter with the silence that a patient thread met."""
        self._wanted.set()
        with self.lock:
            self._wanted.clear()
            error, self._silent = self._silent, None
            yield error
