"""Run a command: signals stop it, it is logged, and it replaces no file."""

import inspect
import logging
import shlex
import signal
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import wraps
from pathlib import Path
from typing import Any, TextIO, get_args

from sautereau.analysis.text import wrapped
from sautereau.commands.common import Dated
from sautereau.commands.output import LATE_WARNINGS, FileOutput, Output, printable
from sautereau.rig.disk import open_to_append

ENDING = ("SIGTERM", "SIGHUP", "SIGUSR1", "SIGUSR2", "SIGALRM", "SIGXCPU", "SIGBREAK")
"""Signals that would end a command without a word; SIGXCPU is of a limit of processor time, and
SIGBREAK of Windows, on Ctrl-Break and where a window is closed."""
_ROOT = logging.getLogger("sautereau")


def run(command: Callable[..., int]) -> Callable[..., int]:
    """Return a command that signals stop, that logs, and that refuses existing files.

    The files are its arguments of the type `OutFile` and of those derived from it. Defaults of the
    type `Dated` get the date of today.
    """
    signature = inspect.signature(command)
    files = [name for name, one in signature.parameters.items() if _is_new_file(one.annotation)]

    @wraps(command)
    def started(*args: Any, **kwargs: Any) -> int:
        given = signature.bind(*args, **kwargs)
        given.apply_defaults()
        output: Output = given.arguments["output"]
        for name, value in given.arguments.items():
            if isinstance(value, Dated):
                given.arguments[name] = path = value.today()
                if not path.suffix:  # the answer names a file
                    output.say(f"recordings go to {path}")
        with signals_stop(), logged(output):
            if not isinstance(output, FileOutput):
                return command(*given.args, **given.kwargs)
            with output.creating(*(given.arguments[name] for name in files)):
                return command(*given.args, **given.kwargs)

    return started


def _is_new_file(annotation: Any) -> bool:
    """Return whether a type is `OutFile` with further metadata, or may be."""
    parts = get_args(annotation)
    return "FILE" in parts or any(map(_is_new_file, parts))


@contextmanager
def signals_stop() -> Iterator[None]:
    """Raise KeyboardInterrupt on each signal of `ENDING`, as on Ctrl-C.

    After one they still do, so that none of them ends the command before its message. A signal that
    is ignored from the start (a closed terminal under nohup), or handled, stays so.
    """

    def interrupt(number: int, _frame: object) -> None:
        raise KeyboardInterrupt(signal.Signals(number).name)

    before = _handle([name for name in ENDING if _is_default(name)], interrupt)
    try:
        yield
    except KeyboardInterrupt:
        before.clear()
        raise
    finally:
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
    _handle(("SIGINT", *ENDING), signal.SIG_IGN)


def _is_default(name: str) -> bool:
    return hasattr(signal, name) and signal.getsignal(getattr(signal, name)) == signal.SIG_DFL


def _handle(names: tuple[str, ...] | list[str], handle: Any) -> dict[str, Any]:
    known = [name for name in names if hasattr(signal, name)]
    return {name: signal.signal(getattr(signal, name), handle) for name in known}


def _restore(before: dict[str, Any]) -> None:
    for name, handler in before.items():
        signal.signal(getattr(signal, name), handler)


@contextmanager
def logged(output: Output) -> Iterator[None]:
    """Log inside the context as a command's options request.

    Raises:
        SautereauError: The log file cannot be written.
    """
    shown = logging.INFO if output.verbose else logging.WARNING
    terminal = _ToTerminal(logging.ERROR if output.quiet else shown)
    handlers: list[logging.Handler] = [terminal]
    if output.log:
        handlers.append(_file(output.log))
    level = _ROOT.level
    _ROOT.setLevel(logging.DEBUG if output.log else shown)
    for handler in handlers:
        _ROOT.addHandler(handler)

    shown_before = warnings.showwarning
    warnings.showwarning = _warned

    def end() -> None:
        warnings.showwarning = shown_before
        for handler in handlers:
            _ROOT.removeHandler(handler)
            handler.close()
        _ROOT.setLevel(level)

    try:
        if output.log:
            from sautereau import __version__

            _ROOT.info("sautereau %s: %s", __version__, shlex.join(sys.argv[1:]))
        yield
    except BaseException as error:
        _ROOT.exception("the command has ended with an error")
        end()
        for warning in LATE_WARNINGS:
            error.add_note(f"warning: {warning}")
        raise
    else:
        end()
        for warning in LATE_WARNINGS:  # those that the answer could not hold
            sys.stderr.write(f"{printable(wrapped(f'warning: {warning}'))}\n")
    finally:
        LATE_WARNINGS.clear()


def _warned(message: Warning | str, *_: object, **__: object) -> None:
    """Log the first line of a library's warning, such as the driver's, and none of its source."""
    _ROOT.warning("%s", next(iter(str(message).strip().splitlines()), ""))


def _file(path: Path) -> logging.Handler:
    from sautereau.rig.disk import make_folder
    from sautereau.rig.errors import SautereauError

    try:
        make_folder(path.parent)
        return _ToFile(path)
    except OSError as error:
        raise SautereauError(
            f"--log {path}: cannot be written: {error.strerror}; give another file"
        ) from error


class _ToTerminal(logging.Handler):
    """Shows steps and warnings; errors are reported when the command ends."""

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno < logging.ERROR:
            head = "warning: " * (record.levelno >= logging.WARNING)
            text = f"{head}{record.getMessage()}"
            sys.stderr.write(f"{printable(wrapped(text))}\n")


class _ToFile(logging.StreamHandler[TextIO]):
    """Appends to a log file; at the first error it ends, and the command continues without it.

    Args:
        path: A regular file, or a new one.

    Raises:
        OSError: It is not, or cannot be written.
    """

    def __init__(self, path: Path):
        self._path = path
        super().__init__(open_to_append(path))
        self.setFormatter(_Dated("%(asctime)s %(levelname)s %(name)s: %(message)s"))

    def emit(self, record: logging.LogRecord) -> None:
        if not self.stream.closed:
            super().emit(record)

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 - of logging
        """Close the file where the disk has no room; show other errors as logging does."""
        if isinstance(error := sys.exception(), OSError):
            self._end(error)
        else:
            super().handleError(record)

    def close(self) -> None:
        try:
            self.stream.close()
        except OSError as error:
            self._end(error)
        super().close()

    def _end(self, error: OSError) -> None:
        LATE_WARNINGS.append(
            f"--log {self._path}: {error.strerror}; the log ends there, the command has continued"
            " without it"
        )
        with suppress(OSError):  # of what could not be written
            self.stream.close()


class _Dated(logging.Formatter):
    """Lines of a log file; dates are UTC."""

    converter = time.gmtime
    default_msec_format = "%s.%03dZ"

    def format(self, record: logging.LogRecord) -> str:
        return printable(super().format(record))
