"""The stand-in's clock: it goes while something is going on, as fast as it can or in real time."""

import threading
import time
from collections.abc import Callable
from typing import Protocol

from sautereau.sim_backend.fair_lock import Turns

SLICE = 2e-3
"""s on the wall's clock, after which the others get a word in, whatever is going on."""


class Clocked(Protocol):
    """What a clock makes go, one controller sample at a time."""

    @property
    def time(self) -> float:
        """s, simulated."""
        ...

    @property
    def busy(self) -> bool:
        """Whether time must go on."""
        ...

    @property
    def awaited(self) -> bool:
        """Whether somebody waits for what is there now."""
        ...

    def tick(self) -> None:
        """Do one controller sample."""
        ...


class Clock:
    """A thread that makes time go on while that is needed; a context manager.

    Args:
        bench: What goes.
        turns: Had while it goes; notified when somebody may go on.
        paced: Whether simulated time keeps to the wall's.
        on_failure: Called, with its turn, when the bench has failed.
    """

    def __init__(
        self, bench: Clocked, turns: Turns, paced: bool, on_failure: Callable[[Exception], None]
    ):
        self._bench, self._turns, self._paced = bench, turns, paced
        self._on_failure = on_failure
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="stand-in clock", daemon=True)

    def __enter__(self) -> "Clock":
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        with self._turns:
            self._stopping = True
            self._turns.notify_all()
        self._thread.join()

    def _run(self) -> None:
        bench, ahead = self._bench, 0.0
        while True:
            with self._turns:
                idle = not bench.busy
                self._turns.wait_for(lambda: bench.busy or self._stopping)
                if self._stopping:
                    return
                if idle:
                    ahead = time.monotonic() - bench.time
                try:
                    self._go_on()
                except Exception as error:  # noqa: BLE001 - handed to whoever asks next
                    self._stopping = True
                    self._on_failure(error)
                self._turns.notify_all()
            # Without its turn, and long enough to let waiting threads run.
            time.sleep(max(0.0, ahead + bench.time - time.monotonic()) if self._paced else 0)

    def _go_on(self) -> None:
        """Go until somebody waits for what is there, or at most for `SLICE`."""
        bench = self._bench
        bench.tick()
        if self._paced:
            return
        end = time.perf_counter() + SLICE
        while bench.busy and not bench.awaited and time.perf_counter() < end:
            bench.tick()
