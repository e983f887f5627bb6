"""The keep-alive: the host renews the count of the controller's watchdog."""

import threading
from collections.abc import Callable
from typing import Self

from sautereau.robot.errors import RobotError

TICKS = 10  # Parts of the watchdog's period, each of which the controller counts down
_RENEWALS = 4  # Renewals in a period of the watchdog, so that one may be lost


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
