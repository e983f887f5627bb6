"""The first interrupt ends a motion; those that follow wait until the motors are off."""

import signal
import threading
import time
from collections.abc import Callable
from types import FrameType
from typing import Self

PAUSE = 1.0
"""s after an interrupt, in which further ones wait: it is on its way through the program."""
_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")


class Interrupts:
    """A context manager that handles signals as before it, but never two in a row.

    In the main thread only, where signals are handled; in others it does nothing. A signal that
    nobody handles keeps its default action. A signal that waited is raised as `KeyboardInterrupt`
    at the end, where no error is raised already.
    """

    def __init__(self) -> None:
        self._before: dict[int, Callable[[int, FrameType | None], object]] = {}
        self._last = -PAUSE
        self._holding = self._waited = False

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for name in _SIGNALS:
                number = getattr(signal, name, None)
                handler = None if number is None else signal.getsignal(number)
                if number is not None and callable(handler):
                    self._before[number] = handler
                    signal.signal(number, self._handle)
        return self

    def hold(self) -> None:
        """Let every signal wait from now on."""
        self._holding = True

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        if self._waited and kind is None:
            raise KeyboardInterrupt

    def _handle(self, number: int, frame: FrameType | None) -> None:
        now = time.monotonic()
        if self._holding or now < self._last + PAUSE:
            self._waited = True
            return
        self._last = now
        self._before[number](number, frame)
