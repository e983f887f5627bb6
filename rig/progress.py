"""Progress of long computations, reported to whoever shows it; without anybody, nothing is done."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

Item = TypeVar("Item")
Show = Callable[[float], None]  # Takes the fraction that is done, 0 to 1

_SHOW: ContextVar[Show | None] = ContextVar("progress", default=None)


@contextmanager
def progress_to(show: Show) -> Iterator[None]:
    """Report the progress of what is computed inside the context."""
    before = _SHOW.get()
    _SHOW.set(show)
    try:
        yield
    finally:
        _SHOW.set(before)


def tracked(items: Sequence[Item]) -> Iterator[Item]:
    """Yield the items of a computation, and report the fraction that is done.

    A computation inside, on one item, reports parts of that item's fraction.
    """
    show, total = _SHOW.get(), len(items)
    if show is None:
        yield from items
        return
    for done, item in enumerate(items):

        def part(fraction: float, done: int = done) -> None:
            show((done + fraction) / total)

        with progress_to(part):
            yield item
        show((done + 1) / total)
