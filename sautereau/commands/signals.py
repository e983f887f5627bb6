"""Signals: what ends, stops or pauses a command."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def signals_stop() -> Iterator[None]:
    """Raise KeyboardInterrupt on SIGTERM and on a closed terminal, as on Ctrl-C.

    After one they still do, so that none of them ends the command before its message. A closed
    terminal that is ignored from the start (nohup) stays ignored.
    """

    def interrupt(number: int, _frame: object) -> None:
        raise KeyboardInterrupt(signal.Signals(number).name)

    names = [name for name in ("SIGTERM", "SIGHUP") if _heeded(name)]
    before = _handle(names, interrupt)
    interrupted = False
    try:
        yield
    except KeyboardInterrupt:
        interrupted = True
        raise
    finally:
        if not interrupted:
            _restore(before)


@contextmanager
def on_signals(names: tuple[str, ...], handle: Callable[[int, Any], None]) -> Iterator[None]:
    """Handle these signals, as far as the system has them, inside the context."""
    before = _handle(names, handle)
    try:
        yield
    finally:
        _restore(before)


def ignore_signals() -> None:
    """Ignore further interrupts: the command is about to end with its message."""
    _handle(("SIGINT", "SIGTERM", "SIGHUP"), signal.SIG_IGN)


def _heeded(name: str) -> bool:
    return hasattr(signal, name) and signal.getsignal(getattr(signal, name)) != signal.SIG_IGN


def _handle(names: tuple[str, ...] | list[str], handle: Any) -> dict[str, Any]:
    known = [name for name in names if hasattr(signal, name)]
    return {name: signal.signal(getattr(signal, name), handle) for name in known}


def _restore(before: dict[str, Any]) -> None:
    for name, handler in before.items():
        signal.signal(getattr(signal, name), handler)
