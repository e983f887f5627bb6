"""Live views during a session."""

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sautereau.robot.experiment.monitor import Feed, Watch


@contextmanager
def watching(title: str, *, in_terminal: bool, to_foxglove: bool) -> "Iterator[Watch]":
    """Yield the function to which a session reports its events; without a view it does nothing.

    Args:
        title: Title of the session.
        in_terminal: Whether to show the session in the terminal.
        to_foxglove: Whether to serve it to Foxglove on this machine.

    Raises:
        LiveError: A view cannot start.
    """
    if not (in_terminal or to_foxglove):
        yield lambda seen: None
        return
    from sautereau.commands.live.process import ViewProcess
    from sautereau.robot.experiment.monitor import Feed

    with ExitStack() as stack:
        views = ViewProcess(title, in_terminal=in_terminal, to_foxglove=to_foxglove)
        feed = Feed([views])
        if in_terminal:
            stack.enter_context(_held_back())
        stack.callback(_report, feed)
        stack.enter_context(views)
        for instruction in views.instructions:
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


def _report(feed: "Feed") -> None:
    """Print the faults of the views, and how many events they did not show."""
    for fault in feed.faults:
        sys.stderr.write(f"warning: live view: {fault}\n")
    if feed.dropped:
        sys.stderr.write(
            f"warning: live view: {feed.dropped} events not shown; the recordings contain all\n"
        )
