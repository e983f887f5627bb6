"""Views in a process of their own: what they compute takes no time from the press.

Python runs one thread of a process at a time, and a host that streams setpoints may not be
late by more than a few milliseconds; a view that draws would make it so.
"""

import signal
from collections.abc import Sequence
from contextlib import ExitStack
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING

from sautereau.rig.errors import SautereauError

if TYPE_CHECKING:
    from sautereau.robot.experiment.monitor import Seen, View

PATIENCE = 30.0
"""s, that the views may take to begin."""
LEAVE = 1.5
"""s, that they may take to end."""


class LiveError(SautereauError):
    """A live view that cannot be had; says why and what to do."""


class ViewProcess:
    """The views of a session, in a process of their own; a context manager.

    Raises:
        LiveError: They cannot begin.
    """

    def __init__(self, title: str, *, in_terminal: bool, to_foxglove: bool):
        context = get_context("spawn")
        self._pipe, self._theirs = context.Pipe()
        wanted = (self._theirs, title, in_terminal, to_foxglove)
        self._process = context.Process(target=_run, args=wanted, name="live view", daemon=True)
        self.told: Sequence[str] = ()
        """What people have to know to look."""

    def __enter__(self) -> "ViewProcess":
        self._process.start()
        self._theirs.close()  # so that its end is heard here
        try:
            if not self._pipe.poll(PATIENCE):
                raise LiveError(
                    f"live view: not there in {PATIENCE:g} s; press without --view and --live"
                )
            begun, self.told = self._pipe.recv()
        except (EOFError, LiveError) as error:
            self.__exit__()
            if isinstance(error, LiveError):
                raise
            raise LiveError(
                "live view: its process has ended at once; press without --view and --live"
            ) from error
        if not begun:
            self.__exit__()
            raise LiveError(" ".join(self.told))
        return self

    def __exit__(self, *exception: object) -> None:
        self._pipe.close()
        self._process.join(LEAVE)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._process.close()

    def show(self, seen: "Sequence[Seen]", dropped: int) -> None:
        """Hand over what has come since the last call, and wait until it is shown."""
        try:
            self._pipe.send((seen, dropped))
            fault = self._pipe.recv()
        except (EOFError, OSError) as error:
            raise LiveError("its process has ended") from error
        if fault:
            raise LiveError(fault)


def _run(pipe: Connection, title: str, in_terminal: bool, to_foxglove: bool) -> None:
    """Show what comes, until the other end of the pipe is closed."""
    # Ctrl-C and a closed terminal are the session's affair, and its end is the views' end.
    for name in ("SIGINT", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    with ExitStack() as stack:
        views: list[View] = []
        told = []
        try:
            if to_foxglove:
                from sautereau.commands.live.foxglove import FoxgloveView

                served = stack.enter_context(FoxgloveView(title))
                views.append(served)
                told.append(served.told)
            if in_terminal:
                from sautereau.commands.live.terminal import TerminalView

                views.append(stack.enter_context(TerminalView(title)))
        except SautereauError as error:
            pipe.send((False, (str(error),)))
            return
        pipe.send((True, tuple(told)))
        while True:
            try:
                seen, dropped = pipe.recv()
                for view in views:
                    view.show(seen, dropped)
                pipe.send("")
            except (EOFError, ConnectionError):
                return
            except Exception as error:  # noqa: BLE001 - the session is told, and tells
                pipe.send(f"{type(error).__name__}: {error}")
                return
