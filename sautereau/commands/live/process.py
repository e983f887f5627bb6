"""Live views of a session, in their own process: their computations do not delay the press.

Python runs one thread of a process at a time. A host that streams setpoints may be late by a
few milliseconds only, and drawing takes longer.
"""

import os
import signal
import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any

from sautereau.commands.live import LiveError
from sautereau.rig.errors import MissingExtraError
from sautereau.robot.experiment.monitor import Feed, Seen, Watch


@contextmanager
def watching(title: str, views: Collection[str]) -> Iterator[Watch]:
    """Yield the function to which a session reports its events; without a view it does nothing.

    Args:
        title: Title of the session.
        views: Options of the command line: `view` shows it in the terminal, `live` serves it to
            Foxglove, and `page` to browsers on this machine.

    Raises:
        LiveError: A view cannot start.
    """
    if not views:
        yield lambda seen: None
        return
    with ExitStack() as stack:
        process = ViewProcess(title, views)
        feed = Feed([process])
        if "view" in views:
            stack.enter_context(_held_back())
        stack.callback(_report, feed)
        stack.enter_context(process)
        for instruction in process.instructions:
            sys.stderr.write(f"{instruction}\n")
        yield stack.enter_context(feed)


@contextmanager
def _held_back() -> Iterator[None]:
    """Hold output to the terminal back until the view has ended."""
    with ExitStack() as stack:
        for stream, redirected in ((sys.stdout, redirect_stdout), (sys.stderr, redirect_stderr)):
            if stream.isatty():
                kept = StringIO()
                stack.callback(lambda stream=stream, kept=kept: stream.write(kept.getvalue()))
                stack.enter_context(redirected(kept))
        yield


def _report(feed: Feed) -> None:
    """Print the faults of the views, and how many events they did not show."""
    for fault in feed.faults:
        sys.stderr.write(f"warning: live view: {fault}\n")
    if feed.dropped:
        sys.stderr.write(
            f"warning: live view: {feed.dropped} events not shown; the recordings contain all\n"
        )


START_TIMEOUT = 30.0  # s, for the views to start
END_TIMEOUT = 1.5  # s, for the views to end


class ViewProcess:
    """The live views of a session in their own process; a context manager.

    Raises:
        LiveError: The views cannot start.
    """

    def __init__(self, title: str, views: Collection[str]):
        context = get_context("spawn")
        self._pipe, self._theirs = context.Pipe()
        arguments = (self._theirs, title, views)
        self._process = context.Process(target=_run, args=arguments, name="live view", daemon=True)
        self.instructions: Sequence[str] = ()
        """How to open the views, for the operator."""

    def __enter__(self) -> "ViewProcess":
        self._process.start()
        self._theirs.close()  # so that the pipe ends when the process does
        try:
            if not self._pipe.poll(START_TIMEOUT):
                raise LiveError(
                    f"live view: not started within {START_TIMEOUT:g} s; press without --view,"
                    " --live and --page"
                )
            started, self.instructions = self._pipe.recv()
            if not started:
                raise LiveError(" ".join(self.instructions))
        except (EOFError, OSError, LiveError) as error:  # OSError: `poll` of Windows
            self.__exit__()
            if isinstance(error, LiveError):
                raise
            raise LiveError(
                "live view: its process ended at the start; press without --view, --live and --page"
            ) from error
        return self

    def __exit__(self, *exception: object) -> None:
        self._pipe.close()
        self._process.join(END_TIMEOUT)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._process.close()

    def show(self, seen: Sequence[Seen], dropped: int) -> None:
        """Send everything new since the last call, and wait until it is shown."""
        try:
            self._pipe.send((seen, dropped))
            fault = self._pipe.recv()
        except (EOFError, OSError) as error:
            raise LiveError("its process has ended") from error
        if fault:
            raise LiveError(fault)


def _run(pipe: Connection, title: str, wanted: Collection[str]) -> None:
    """Show everything received, until the other end of the pipe is closed."""
    # The session handles Ctrl-C and a closed terminal; the views end when it does.
    for name in ("SIGINT", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    with ExitStack() as stack:
        try:
            views = list(map(stack.enter_context, _views(title, wanted)))
        except (LiveError, MissingExtraError, OSError) as error:
            pipe.send((False, (str(error),)))
            return
        pipe.send((True, tuple(v.instruction for v in views if hasattr(v, "instruction"))))
        while True:
            try:
                seen, dropped = pipe.recv()
                for view in views:
                    view.show(seen, dropped)
                pipe.send("")
            except (EOFError, ConnectionError):
                return
            except Exception as error:  # noqa: BLE001 - the session reports it
                pipe.send(f"{type(error).__name__}: {error}")
                return


def _views(title: str, wanted: Collection[str]) -> Iterator[Any]:
    """Yield the views that are requested, to be entered."""
    if "live" in wanted:
        from sautereau.commands.live.foxglove import FoxgloveView

        yield FoxgloveView(title)
    if "page" in wanted:
        from sautereau.commands.live.page import PageView

        if hasattr(os, "nice"):
            os.nice(10)  # its reports take a processor; the press comes first
        yield PageView(title)
    if "view" in wanted:
        from sautereau.commands.live.terminal import TerminalView

        yield TerminalView(title)
