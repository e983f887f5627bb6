"""The events of a running session, passed to live views without waiting for them; its control.

`Control` pauses, resumes and aborts a session from another thread.
"""

import logging
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, Full, Queue
from typing import Protocol

from sautereau.daq.file.recorded import Block
from sautereau.rig.acquisition import Channel
from sautereau.robot.controller import MotionController
from sautereau.robot.errors import RobotError

_LOG = logging.getLogger(__name__)
PATIENCE = 2.0  # s, that the end of a session waits for the views to show everything


@dataclass(frozen=True)
class Stage:
    """The stage that a session has reached."""

    arm: str
    """Activity of the arm."""
    daq: str
    """Activity of the acquisition."""
    press: int | None = None
    """Number of the press's file; None between presses."""


@dataclass(frozen=True)
class Samples:
    """Samples of a press, as they were read."""

    press: int
    channels: tuple[Channel, ...]
    """Channels of the block, in its order."""
    rate: float
    """Hz."""
    block: Block


@dataclass(frozen=True)
class Made:
    """A press whose recording is complete and on the disk."""

    press: int
    path: Path


@dataclass(frozen=True)
class Fault:
    """The error that ended the session."""

    text: str


Seen = Stage | Samples | Made | Fault
Watch = Callable[[Seen], None]
"""Called with each event; must not wait, and an error of it ends the session."""


def logged(watch: Watch) -> Watch:
    """Return a function that logs the steps of a session, and passes each event on."""

    def seen(one: Seen) -> None:
        if isinstance(one, Stage):
            press = f"press {one.press}: " if one.press is not None else ""
            _LOG.info("%sarm %s, acquisition %s", press, one.arm, one.daq)
        elif isinstance(one, Made):
            _LOG.info("press %d recorded: %s", one.press, one.path)
        watch(one)

    return seen


class View(Protocol):
    """Displays a session."""

    def show(self, seen: Sequence[Seen], dropped: int) -> None:
        """Show the events since the last call; there may be none.

        Args:
            seen: In order of time.
            dropped: Number of events since the start that are missing.
        """


class Feed:
    """Takes events without waiting, and shows them from a separate thread.

    Events that come while its queue is full are dropped and counted. A view that fails gets no
    more events; the session continues. Use it as a context manager.
    """

    def __init__(self, views: Sequence[View], depth: int = 512, period: float = 0.1):
        """Prepare.

        Args:
            views: All get the same events.
            period: s, between two updates.
        """
        self._views, self._period = list(views), period
        self._queue: Queue[Seen] = Queue(depth)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live view", daemon=True)
        self.dropped = 0
        """Events that were not shown."""
        self.faults: list[str] = []
        """Errors of views that ended before the session."""

    def __call__(self, seen: Seen) -> None:
        """Take an event; return at once."""
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
            except Exception as error:  # noqa: BLE001 - reported in `faults`
                self._views.remove(view)
                self.faults.append(f"{type(view).__name__}: {type(error).__name__}: {error}")


class Control:
    """What the operator has requested; methods may be called from any thread."""

    def __init__(self):
        self._running = threading.Event()
        self._running.set()
        self._aborted = self._closed = False
        self._controller: MotionController | None = None

    @property
    def paused(self) -> bool:
        """Whether no further press may start."""
        return not self._running.is_set()

    def pause(self) -> None:
        """Let the present press end, then go home and switch the motors off."""
        self._running.clear()

    def resume(self) -> None:
        """Continue with the next press."""
        self._running.set()

    def abort(self) -> None:
        """End the session: the arm is stopped at once, and its motors are switched off.

        While samples are read it stops within a block of them.
        """
        self._aborted = True
        self._running.set()
        if (controller := self._controller) is not None:
            controller.request_abort()

    def close(self) -> None:
        """End the session, and let no other one start."""
        self._closed = True
        self.abort()

    def wait(self) -> None:
        """Wait while the session is paused.

        Raises:
            RobotError: It was aborted or closed.
        """
        self._running.wait()
        if self._closed:
            raise RobotError(
                "bench: its `with` block has ended, and with it every session; press inside the"
                " block, or take another bench"
            )
        self._check()

    @contextmanager
    def over(self, controller: MotionController) -> Iterator[MotionController]:
        """Abort the motions of a controller in the block as well."""
        self._controller = controller
        try:
            yield controller
        finally:
            self._controller = None

    def watched(self, watch: Watch) -> Watch:
        """Return a watch that also ends an aborted session."""

        def seen(event: Seen) -> None:
            watch(event)
            if isinstance(event, Fault):
                self._aborted = False
            else:
                self._check()

        return seen

    def _check(self) -> None:
        if self._aborted:
            self._aborted = False
            raise RobotError("session: aborted by the operator; run the same again to continue it")
