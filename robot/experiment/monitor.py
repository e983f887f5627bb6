"""What is seen of a session while it goes on, handed to views that it never waits for."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, Full, Queue
from typing import Protocol

from sautereau.daq.file.recorded import Block
from sautereau.rig.acquisition import Channel

PERIOD = 0.1
"""s, between two looks of the views."""
DEPTH = 512
"""Things seen that may wait for the views: 10 s of samples at 51.2 kHz."""
PATIENCE = 2.0
"""s, that the end of a session waits for the views to have shown all."""


@dataclass(frozen=True)
class Stage:
    """How far a session is."""

    arm: str
    """What the arm does."""
    daq: str
    """What the acquisition does."""
    press: int | None = None
    """Number of the press's file; None between presses."""


@dataclass(frozen=True)
class Samples:
    """Samples of a press, as they were read."""

    press: int
    channels: tuple[Channel, ...]
    """Of the block, in its order."""
    rate: float
    """Hz."""
    block: Block


@dataclass(frozen=True)
class Made:
    """A press whose recording is whole and on the disk."""

    press: int
    path: Path


@dataclass(frozen=True)
class Fault:
    """What ended the session."""

    text: str


Seen = Stage | Samples | Made | Fault
Watch = Callable[[Seen], None]
"""Is told what happens; must neither wait nor fail."""


class View(Protocol):
    """Shows a session to somebody."""

    def show(self, seen: Sequence[Seen], dropped: int) -> None:
        """Show what has come since the last call, maybe nothing.

        Args:
            seen: In the order in which it happened.
            dropped: How much has not come, of all that happened so far.
        """
        ...


class Feed:
    """Takes what happens without ever waiting, and shows it in a thread of its own.

    What comes while its queue is full is dropped and counted. A view that fails is shown
    nothing more; the session goes on. Use it as a context manager.
    """

    def __init__(self, views: Sequence[View], depth: int = DEPTH, period: float = PERIOD):
        """Prepare.

        Args:
            views: All are shown the same.
            depth: Of the queue.
            period: s, between two looks.
        """
        self._views, self._period = list(views), period
        self._queue: Queue[Seen] = Queue(depth)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live view", daemon=True)
        self.dropped = 0
        """Things that happened and were not shown."""
        self.faults: list[str] = []
        """Why a view has ended before the session."""

    def __call__(self, seen: Seen) -> None:
        """Take what has happened; return at once."""
        try:
            self._queue.put_nowait(seen)
        except Full:
            self.dropped += 1

    def __enter__(self) -> "Feed":
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._ended.set()
        self._thread.join(PATIENCE)
        if self._thread.is_alive():
            self.faults.append(f"a view has not shown the end of the session in {PATIENCE:g} s")

    def _run(self) -> None:
        while not self._ended.wait(self._period):
            self._show()
        self._show()

    def _show(self) -> None:
        seen: list[Seen] = []
        try:
            while len(seen) < self._queue.maxsize:
                seen.append(self._queue.get_nowait())
        except Empty:
            pass
        for view in list(self._views):
            try:
                view.show(seen, self.dropped)
            except Exception as error:  # noqa: BLE001 - whoever began the session is told
                self._views.remove(view)
                self.faults.append(f"{type(view).__name__}: {type(error).__name__}: {error}")
