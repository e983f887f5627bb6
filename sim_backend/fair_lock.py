"""A lock that who needs it all the time cannot keep from the others."""

import threading
from collections.abc import Callable


class Turns:
    """A lock that is had in turn, not twice by one thread, and on which one may wait.

    Plain locks go to whoever is quickest, which is a thread that lets go and takes again.
    Here who asks first holds the gate until the lock is free, and the others queue there.
    """

    def __init__(self) -> None:
        self._gate = threading.Lock()
        self._condition = threading.Condition(threading.Lock())

    def __enter__(self) -> None:
        with self._gate:
            self._condition.acquire()

    def __exit__(self, *exception: object) -> None:
        self._condition.release()

    def wait_for(self, met: Callable[[], bool], timeout: float | None = None) -> bool:
        """Let the lock go until a condition is met or timeout [s] has passed."""
        return self._condition.wait_for(met, timeout)

    def notify_all(self) -> None:
        """Let everybody who waits look at his condition again."""
        self._condition.notify_all()
