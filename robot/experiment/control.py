"""Pause, resume and abort a session from another thread."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from sautereau.robot.controller import MotionController
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.monitor import Fault, Seen, Watch


class Control:
    """What the operator has requested; methods may be called from any thread."""

    def __init__(self):
        self._running = threading.Event()
        self._running.set()
        self._aborted = False
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

    def wait(self) -> None:
        """Wait while the session is paused.

        Raises:
            RobotError: It was aborted.
        """
        self._running.wait()
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
