"""Shared by the commands: parameters, answers and errors, and the bench that they run on."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from sautereau.analysis.model.plectrum.levels import levels_help

if TYPE_CHECKING:
    from sautereau.entrance.bench import Bench
    from sautereau.entrance.session import Session
    from sautereau.rig.schema import Rig
    from sautereau.sim_backend.scene import Scene

OutFile = Annotated[Path, "FILE"]
OutFolder = Annotated[Path, "FOLDER"]
"""The text names the value in the message for a missing option."""
Json = Annotated[bool, Parameter(help="Print one JSON object, in SI units.")]
RigName = Annotated[str, Parameter(help="Path of a rig file, or name of a packaged one.")]
Level = Annotated[str, Parameter(help=levels_help())]
PICTURES = (".png", ".svg", ".pdf", ".jpg", ".webp", ".eps")
"""File extensions of the plots that can be written."""
SCHEMA = 1
"""Version of the JSON that commands print; raised when a key changes its name or meaning."""


def _check_plot_path(_: object, path: Path | None) -> None:
    """Refuse a path to which no plot can be written, before the computation."""
    if path is None:
        return
    faults = []
    if path.suffix.lower() not in PICTURES:
        ending = f"the file extension {path.suffix}" if path.suffix else "no file extension"
        faults.append(f"it has {ending}; use one of {', '.join(PICTURES)}")
    if not path.parent.is_dir():
        faults.append(f"there is no folder {path.parent}; make it first")
    if faults:
        raise ValueError(f"Plot {path}: {'; '.join(faults)}.")


def _check_seed(_: object, value: int | None) -> None:
    if value is not None and not 0 <= value < 2**63:
        raise ValueError("A seed is an integer from 0 to 2**63 - 1.")


Picture = Annotated[
    Path | None,
    Parameter(help="Save the plot here (.png, .svg, .pdf).", validator=_check_plot_path),
]
Seed = Annotated[int | None, Parameter(validator=_check_seed)]


@Parameter(name="*")
@dataclass(frozen=True)
class Simulation:
    """The stand-in instead of the hardware."""

    sim: bool = False
    """Run on the stand-in instead of the hardware."""
    scene: str | None = None
    """Scene of the stand-in, by path or packaged name; implies --sim. Default: paper."""
    seed: Seed = None
    """Seed of every random number. Default: a new one, which is recorded."""

    @property
    def requested(self) -> bool:
        """Whether to run on the stand-in."""
        return self.sim or self.scene is not None

    def load(self) -> "Scene":
        """Return the stand-in's scene."""
        from sautereau.sim_backend.scene import load_scene

        return load_scene(self.scene or "paper")


def load_rig(name: str) -> "Rig":
    from sautereau.rig.load import load_rig

    return load_rig(name)


def bench(rig: "str | Rig", simulation: Simulation, *, moves: bool = True) -> "Bench":
    """Return the bench that a command runs on.

    Args:
        rig: A rig, the path of its file, or the name of a packaged one.
        simulation: What was requested of the stand-in.
        moves: Whether the arm moves: then the hardware needs a rig file of the user's own.

    Raises:
        RigError: The hardware would move by a packaged rig; its limits are of another arm.
    """
    from sautereau.entrance import bench as benches
    from sautereau.entrance.rig import Rig as Own

    if simulation.requested:
        return benches.stand_in(rig, simulation.load(), simulation.seed)
    return benches.bench(rig) if moves else benches.Bench(Own(rig))


def opened(what: "list[Path]", *, samples: bool = False) -> "Session":
    """Open recordings, and read all of them.

    Args:
        what: Recordings, folders of sessions, or patterns.
        samples: Whether to keep all samples.
    """
    from sautereau.entrance.session import open

    session = open(what)
    with bar(len(session)) as step:
        return session.read(step, samples=samples)


@contextmanager
def signals_stop() -> Iterator[None]:
    """Raise KeyboardInterrupt on SIGTERM and on a closed terminal, as on Ctrl-C.

    After one they still do, so that none of them ends the command before its message.
    """

    def interrupt(number: int, _frame: object) -> None:
        raise KeyboardInterrupt(signal.Signals(number).name)

    before = _handle(("SIGTERM", "SIGHUP"), interrupt)
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


def _handle(names: tuple[str, ...], handle: Any) -> dict[str, Any]:
    known = [name for name in names if hasattr(signal, name)]
    return {name: signal.signal(getattr(signal, name), handle) for name in known}


def _restore(before: dict[str, Any]) -> None:
    for name, handler in before.items():
        signal.signal(getattr(signal, name), handler)


@contextmanager
def bar(total: int) -> Iterator[Callable[[], None]]:
    """Yield a function that advances a progress bar by one step of several; see `fraction_bar`."""
    steps = count(1)
    with fraction_bar(shown=total > 1) as show:
        yield lambda: show(next(steps) / total)


@contextmanager
def fraction_bar(shown: bool = True) -> Iterator[Callable[[float], None]]:
    """Yield a function that sets a progress bar to a fraction; without a terminal, no bar."""
    if not (shown and sys.stderr.isatty()):
        yield lambda fraction: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=1.0)
        yield lambda fraction: progress.update(task, completed=fraction)


def json_text(result: dict[str, Any]) -> str:
    import json

    return json.dumps(result, indent=2, default=str, allow_nan=False)


def answer(
    as_json: bool, result: dict[str, Any], lines: list[str], picture: Path | None = None
) -> int:
    """Print the result of a command, and its plot's path: as JSON with its schema, or as lines.

    Returns:
        The exit status, 0.
    """
    if picture:
        result, lines = result | {"picture": str(picture)}, [*lines, f"picture: {picture}"]
    text = json_text({"schema": SCHEMA} | result) if as_json else "\n".join(lines)
    sys.stdout.write(printable(text) + "\n")
    return 0


def say(as_text: bool, line: str) -> None:
    """Print a line while a command runs, unless its answer is JSON."""
    if as_text:
        sys.stdout.write(printable(line) + "\n")
        sys.stdout.flush()


def warn(as_text: bool, *warnings: str) -> None:
    """Print warnings on standard error, unless the answer is JSON, which holds them."""
    if as_text:
        sys.stderr.writelines(f"warning: {printable(warning)}\n" for warning in warnings)


_CONTROL = {
    code: f"\\x{code:02x}" for code in (*range(0x20), *range(0x7F, 0xA0)) if chr(code) not in "\n\t"
} | {code: f"\\u{code:04x}" for code in (*range(0x202A, 0x202F), *range(0x2066, 0x206A))}


def printable(text: str) -> str:
    """Return a text with its control characters made visible.

    Notes, names and file names come from files: an escape sequence in them must not reach the
    terminal, nor a mark that changes the direction of writing.
    """
    return text.translate(_CONTROL)


def write(path: Path, text: str) -> None:
    from sautereau.rig.disk import make_folder, write_durably

    make_folder(path.parent)
    write_durably(path, text + "\n")


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
    text = json_text({"schema": SCHEMA, "error": error}) if as_json else f"sautereau: {message}"
    sys.stderr.write(printable(text) + "\n")
    return status
