"""Fair lock: waiting threads get it in order of arrival."""

import threading
from collections.abc import Callable


class FairLock:
    """A lock that waiting threads get in order of arrival, with a condition to wait for.

    A plain lock goes to the quickest thread, which is often the one that has just released it.
    Here the thread that asks first holds a gate until the lock is free; the others queue at
    the gate. It is not reentrant.
    """

    def __init__(self) -> None:
        self._gate = threading.Lock()
        self._condition = threading.Condition(threading.Lock())

    def __enter__(self) -> None:
        with self._gate:
            self._condition.acquire()

    def __exit__(self, *exception: object) -> None:
        self._condition.release()

    def wait_for(self, holds: Callable[[], bool], timeout: float | None = None) -> bool:
        """Release the lock until a condition holds or timeout [s] has passed."""
        return self._condition.wait_for(holds, timeout)

    def notify_all(self) -> None:
        """Make all waiting threads check their conditions again."""
        self._condition.notify_all()
