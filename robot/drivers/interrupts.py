"""The first interrupt ends a motion; those that follow wait until the motors are off."""

import signal
import threading
import time
from collections.abc import Callable
from types import FrameType
from typing import Self

PAUSE = 1.0  # Time in s after an interrupt in which further ones wait, while the program handles it
_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")


class Interrupts:
    """A context manager that passes signals to their handlers, but delays those that follow soon.

    It acts in the main thread only, which handles signals. A signal without a handler keeps its
    default action. At the end a delayed signal is raised as `KeyboardInterrupt`, unless an error is
    being raised already. If it ends in another thread, as when that one frees a generator which was
    never closed, the handlers cannot be replaced, and pass on every signal.
    """

    def __init__(self) -> None:
        self._before: dict[int, Callable[[int, FrameType | None], object]] = {}
        self._last = -PAUSE
        self._holding = self._waited = self._ended = False

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
        """Delay all signals from now on."""
        self._holding = True

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        self._ended = True
        if threading.current_thread() is threading.main_thread():
            for number, handler in self._before.items():
                signal.signal(number, handler)
        if self._waited and kind is None:
            raise KeyboardInterrupt

    def _handle(self, number: int, frame: FrameType | None) -> None:
        now = time.monotonic()
        if not self._ended and (self._holding or now < self._last + PAUSE):
            self._waited = True
            return
        self._last = now
        self._before[number](number, frame)
