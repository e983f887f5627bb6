"""The stand-in's clock and the lock of its threads.

Simulated time advances while the bench is busy, at full speed or paced.
"""

import math
import threading
import time
from collections.abc import Callable
from typing import Any


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


class Clock:
    """A thread that advances simulated time while the bench is busy; a context manager.

    Args:
        bench: What it advances, as `sautereau.sim_backend.bench.Bench`: with `time` [s], `busy`,
            `line_busy`, `awaited` and `tick`.
        lock: Held while it advances; notified after each slice.
        paced: Whether simulated time follows real time.
        on_failure: Called, under the lock, when the bench has failed.
    """

    def __init__(
        self, bench: Any, lock: FairLock, paced: bool, on_failure: Callable[[Exception], None]
    ):
        self._bench, self._lock, self._paced = bench, lock, paced
        self._on_failure = on_failure
        self._stopping = False
        self._ahead = 0.0
        self._thread = threading.Thread(target=self._run, name="stand-in clock", daemon=True)

    @property
    def passed(self) -> float:
        """Simulated time [s] that has passed by the real clock; inf if it is not paced.

        A paced tick is computed when its time begins, so that the bench is ahead of it.
        """
        return time.perf_counter() - self._ahead if self._paced else math.inf

    def __enter__(self) -> "Clock":
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        with self._lock:
            self._stopping = True
            self._lock.notify_all()
        self._thread.join()

    def _run(self) -> None:
        bench = self._bench
        while True:
            with self._lock:
                idle = not bench.busy
                self._lock.wait_for(lambda: bench.busy or self._stopping)
                if self._stopping:
                    return
                late = time.perf_counter() - self._ahead - bench.time
                # s, for sleeping is not exact. A clock that is later falls behind: a device that
                # caught up would have samples before their time.
                if idle or late > 2e-4:
                    self._ahead += late
                before = bench.time
                try:
                    self._advance()
                except Exception as error:  # noqa: BLE001 - reported by the bench's next call
                    self._stopping = True
                    self._on_failure(error)
                self._lock.notify_all()
            # Outside the lock, and long enough for waiting threads to run.
            since = self.passed if self._paced else before if bench.line_busy else bench.time
            time.sleep(max(0.0, bench.time - since))

    def _advance(self) -> None:
        """Do one sample in real time; else as many as 2 ms allow while no thread waits."""
        bench = self._bench
        bench.tick()
        end = time.perf_counter() + 2e-3 * (not self._paced)
        while bench.busy and not (bench.awaited or bench.line_busy) and time.perf_counter() < end:
            bench.tick()
