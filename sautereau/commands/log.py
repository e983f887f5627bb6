"""The log of a command: steps and warnings on standard error, everything in a file."""

import logging
import shlex
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sautereau.analysis.summary.text import wrapped
from sautereau.commands.output import Output, printable

_ROOT = logging.getLogger("sautereau")


class _ToTerminal(logging.Handler):
    """Shows steps and warnings; errors are reported when the command ends."""

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno < logging.ERROR:
            head = "warning: " * (record.levelno >= logging.WARNING)
            text = f"{head}{record.getMessage()}"
            sys.stderr.write(f"{printable(wrapped(text))}\n")


class _Dated(logging.Formatter):
    """Lines of a log file; dates are UTC."""

    converter = time.gmtime
    default_msec_format = "%s.%03dZ"

    def format(self, record: logging.LogRecord) -> str:
        return printable(super().format(record))


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
    try:
        if output.log:
            from sautereau import __version__

            _ROOT.info("sautereau %s: %s", __version__, shlex.join(sys.argv[1:]))
        yield
    except BaseException:
        _ROOT.exception("the command has ended with an error")
        raise
    finally:
        for handler in handlers:
            _ROOT.removeHandler(handler)
            handler.close()
        _ROOT.setLevel(level)


def _file(path: Path) -> logging.Handler:
    from sautereau.rig.disk import make_folder
    from sautereau.rig.errors import SautereauError

    try:
        make_folder(path.parent)
        handler = logging.FileHandler(path, encoding="utf-8", errors="backslashreplace")
    except OSError as error:
        raise SautereauError(
            f"--log {path}: cannot be written: {error.strerror}; give another file"
        ) from error
    handler.setFormatter(_Dated("%(asctime)s %(levelname)s %(name)s: %(message)s"))
    return handler
