"""Who looks at a session while it goes on."""

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sautereau.robot.experiment.monitor import Feed, Watch


@contextmanager
def watching(title: str, *, in_terminal: bool, to_foxglove: bool) -> "Iterator[Watch]":
    """Yield what a session tells what happens; nobody hears it where nobody wants to see it.

    Args:
        title: Of the session.
        in_terminal: Whether the terminal shows it.
        to_foxglove: Whether Foxglove may come and look, from this machine.

    Raises:
        LiveError: A view cannot begin.
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
            stack.enter_context(_kept_from_the_terminal())
        stack.callback(_tell, feed)
        stack.enter_context(views)
        for text in views.told:
            sys.stderr.write(f"{text}\n")
        yield stack.enter_context(feed)


@contextmanager
def _kept_from_the_terminal() -> Iterator[None]:
    """Keep what is said until the view has left the terminal."""
    with ExitStack() as stack:
        for stream, redirected in (
            (sys.stdout, redirect_stdout),
            (sys.stderr, redirect_stderr),
        ):
            if stream.isatty():
                kept = StringIO()
                stack.callback(lambda stream=stream, kept=kept: stream.write(kept.getvalue()))
                stack.enter_context(redirected(kept))
        yield


def _tell(feed: "Feed") -> None:
    """Say what the views have not shown."""
    for fault in feed.faults:
        sys.stderr.write(f"warning: live view: {fault}\n")
    if feed.dropped:
        sys.stderr.write(
            f"warning: live view: {feed.dropped} things that happened were not shown; the"
            " recordings have them all\n"
        )
