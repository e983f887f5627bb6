"""What a command prints and where: its answer, warnings and errors, progress, and its log."""

import logging
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Group, Parameter

from sautereau.analysis.text import wrapped

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from sautereau.analysis.results.result import Result

SCHEMA = 1  # Version of the JSON that commands print; raised when a key changes its name or meaning
READ_ONLY = "no permission to write into it"
_GENERAL = Group("General options", sort_key=100)
LATE_WARNINGS: list[str] = []
"""Warnings of this command that its answer is to contain; the answer takes them."""
_LOG = logging.getLogger(__name__)


@Parameter(name="*", group=_GENERAL)
@dataclass(frozen=True)
class Output:
    """How a command prints."""

    json: bool = False
    """Print one JSON object, in SI units."""
    verbose: Annotated[bool, Parameter(name=["-v", "--verbose"])] = False
    """Show every step, and all details of the result."""
    quiet: Annotated[bool, Parameter(name=["-q", "--quiet"])] = False
    """Print only errors, and the result if --json is given."""
    log: Annotated[Path | None, "FILE"] = None
    """Append steps, warnings, errors and all traffic with the controller to this file, with
    dates."""

    def answer(
        self,
        result: dict[str, Any],
        lines: list[str],
        picture: Path | None = None,
        faults: Sequence[str] = (),
        *,
        draw: "Callable[[], Figure] | None" = None,
    ) -> int:
        """Print the result of a command, and its plot's path: as JSON with its schema, or as lines.

        Args:
            draw: Makes the plot, if one is requested; None if it is in its file already.
            faults: Reported as one error after the result, which lacks what they are about.

        Returns:
            The exit status: 0, or 1 with faults.
        """
        if picture and draw:
            save_plot(picture, draw())
        if LATE_WARNINGS and (self.json or not self.quiet):
            result = result | {"warnings": [*result.get("warnings", ()), *LATE_WARNINGS]}
            lines = [*lines, *(f"warning: {warning}" for warning in LATE_WARNINGS)]
            LATE_WARNINGS.clear()
        if picture:
            result, lines = result | {"picture": str(picture)}, [*lines, f"picture: {picture}"]
        if self.json:
            _write(json_text({"schema": SCHEMA} | result))
        elif not self.quiet:
            _write(wrapped("\n".join(lines)))
        return self.fail("\n".join(faults)) if faults else 0

    def show(
        self,
        found: "Result",
        plot: Path | None,
        faults: list[str] | None = None,
        *,
        lines: list[str] | None = None,
    ) -> int:
        """Save the plot of a result, if one is requested, and print the result as `answer` does.

        Args:
            faults: Those of `answer`, which the JSON lists as well; None where there can be none.
            lines: The result as text; None for its own.
        """
        document = found.document if faults is None else found.document | {"faults": faults}
        lines = found.lines() if lines is None else lines
        return self.answer(document, lines, plot, faults or (), draw=found.plot)

    def say(self, text: str, *, as_it_is: bool = False) -> None:
        """Print a text while a command runs, unless its answer is JSON.

        Args:
            text: One line or several.
            as_it_is: Whether to keep long lines.
        """
        if not (self.json or self.quiet):
            _write(text if as_it_is else wrapped(text))

    def warn(self, *warnings: str) -> None:
        """Log warnings, which are shown unless the answer is JSON, which holds them."""
        for warning in warnings:
            _LOG.log(logging.INFO if self.json else logging.WARNING, "%s", warning)

    def fail(self, message: str, status: int = 1) -> int:
        """Report an error; see `fail`."""
        _LOG.error("%s", message)
        return fail(self.json, message, status)

    @contextmanager
    def progress(self, label: str, *, shown: bool = True) -> Iterator[Callable[[float], None]]:
        """Show a progress bar with the time left, on a terminal only.

        It shows what computations inside report (`sautereau.rig.progress`).

        Args:
            label: What is being done.
            shown: Whether to show the bar.

        Yields:
            A function that sets the bar to a fraction.
        """
        _LOG.info("%s", label)
        if not shown or self.quiet or not sys.stderr.isatty():
            yield lambda fraction: None
            return
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TimeRemainingColumn

        from sautereau.rig.progress import progress_to

        with Progress(
            "{task.description}",
            BarColumn(),
            TaskProgressColumn(),
            TimeRemainingColumn(),
            console=Console(stderr=True),
            transient=True,
            redirect_stdout=sys.stdout.isatty(),
            speed_estimate_period=600.0,  # s, for the time left
        ) as bar:
            task = bar.add_task(label, total=None)  # a pulse, until a fraction is known

            def show(fraction: float) -> None:
                bar.update(task, completed=fraction, total=1.0)

            with progress_to(show):
                yield show


@Parameter(name="*", group=_GENERAL)
@dataclass(frozen=True)
class FileOutput(Output):
    """How a command prints, and whether it replaces files."""

    force: bool = False
    """Replace existing files. Without this option the command refuses them before it starts."""

    @contextmanager
    def creating(self, *paths: Path | None) -> Iterator[None]:
        """Make the folders of new files; see `replacing` about existing files.

        Raises:
            SautereauError: Lists the files that exist, or the folders that cannot be written.
        """
        with self.replacing(*paths):
            make_folders(*paths)
            yield

    @contextmanager
    def replacing(self, *paths: Path | None) -> Iterator[None]:
        """Refuse existing files, or with `force` let the new ones inside replace them.

        An old file is there until the new one takes its name.

        Raises:
            SautereauError: Lists the files that exist.
        """
        from sautereau.rig.disk import replacing

        with replacing(self.refuse(*paths)):
            yield

    def refuse(self, *paths: Path | None) -> list[Path]:
        """Refuse folders, and existing files unless `force` is given; then return them.

        A page that this program has written, and nobody has changed since, is not refused.

        Raises:
            SautereauError: Lists the folders, the files that exist, and those whose folder is
                read-only.
        """
        from sautereau.rig.disk import unchanged
        from sautereau.rig.errors import SautereauError

        given = [path for path in dict.fromkeys(paths) if path]
        there = [path for path in given if path.is_file() or path.is_symlink()]
        faults = [
            f"{p} is {'a folder' if p.is_dir() else 'not a regular file'}; give the name of a file"
            for p in given
            if p.exists() and not p.is_file()
        ]
        folders = dict.fromkeys(path.parent for path in given)
        faults += [
            f"folder {folder}: {READ_ONLY}; give another folder"
            for folder in folders
            if folder.is_dir() and not _writable(folder)
        ]
        if not self.force:
            kept = [path for path in there if path.suffix != ".html" or not unchanged(path)]
            faults += [f"{path} already exists; give another name, or --force" for path in kept]
        if faults:
            raise SautereauError("\n".join(faults))
        return there


def has(path: Path, text: str, *, within: bool = False) -> bool:
    """Return whether a file is, or contains, a text: so a command may leave it that is then killed.

    A repetition of that command need not refuse it. What was beside a file that is the text when
    the command was killed is removed.
    """
    from sautereau.rig.disk import read_limited, remove_left

    try:
        content = read_limited(path)
    except OSError:
        return False
    known = text.encode("utf-8")
    if within:
        return known in content
    if same := known == content:
        remove_left(path)
    return same


def make_folders(*paths: Path | None) -> None:
    """Make the folders of files to write, before a long computation.

    Raises:
        SautereauError: Lists the folders that cannot be made or written.
    """
    from sautereau.rig.disk import make_folder, why_unreadable
    from sautereau.rig.errors import SautereauError

    faults = []
    for folder in dict.fromkeys(path.parent for path in paths if path):
        try:
            make_folder(folder)
        except OSError as error:
            why = f"it cannot be made: {why_unreadable(error)}"
        else:
            why = "" if _writable(folder) else READ_ONLY
        if why:
            faults.append(f"folder {folder}: {why}; give another folder")
    if faults:
        raise SautereauError("\n".join(faults))


def save_plot(path: Path, figure: "Figure", dpi: int = 120) -> None:
    """Write a plot in the format of the file extension.

    Raises:
        OSError: It cannot be written, or exists already; see `sautereau.rig.disk.new_file`.
    """
    from sautereau.rig.disk import write_durably

    held = BytesIO()  # on a full disk, matplotlib ends a PDF with an error of its own
    figure.savefig(held, format=path.suffix[1:].lower(), dpi=dpi)
    write_durably(path, held.getvalue())


def _writable(folder: Path) -> bool:
    return os.access(folder, os.W_OK)


def _write(text: str) -> None:
    """Write to standard output at once, with escapes for what its encoding cannot express.

    Raises:
        BrokenPipeError: Its reader has ended.
        SautereauError: It cannot be written.
    """
    encoding = sys.stdout.encoding or "utf-8"
    text = printable(text).encode(encoding, "backslashreplace").decode(encoding)
    try:
        sys.stdout.write(text + "\n")
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        from sautereau.rig.errors import SautereauError

        end_output()
        raise SautereauError(
            f"standard output: cannot be written: {error.strerror}; send it elsewhere"
        ) from error


def end_output() -> None:
    """Discard what standard output still holds, and what is written to it from now on."""
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, sys.stdout.fileno())
    os.close(nothing)


def json_text(result: dict[str, Any]) -> str:
    """Return an object as JSON; NaN is refused."""
    import json

    return json.dumps(result, indent=2, default=str, allow_nan=False)


_CONTROL = {
    code: f"\\x{code:02x}" for code in (*range(0x20), *range(0x7F, 0xA0)) if chr(code) not in "\n\t"
} | {code: f"\\u{code:04x}" for code in (*range(0x202A, 0x202F), *range(0x2066, 0x206A))}


def printable(text: str) -> str:
    """Return a text with its control characters made visible.

    Notes, names and file names come from files: an escape sequence in them must not reach the
    terminal, nor a mark that changes the direction of writing.
    """
    return text.translate(_CONTROL)


def fail(as_json: bool, message: str, status: int = 1, **more: str) -> int:
    """Report an error on standard error, as text or as one JSON object.

    Args:
        as_json: Whether `--json` was given.
        message: The error and how to fix it.
        status: Exit status: 1, or 2 for wrong usage.
        more: Further keys of the JSON object.

    Returns:
        The status.
    """
    error = {"message": message, "status": status, **more}
    text = f"sautereau: {message}"
    text = json_text({"schema": SCHEMA, "error": error}) if as_json else wrapped(text)
    sys.stderr.write(printable(text) + "\n")
    return status
