"""Shared by the commands: their parameters, and the bench and recordings that they name."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import date
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Group, Parameter, Token
from cyclopts.validators import Number as Range

from sautereau.analysis.model.plectrum.levels import LEVELS, levels_help
from sautereau.commands.output import Output

if TYPE_CHECKING:
    from sautereau.entrance.bench import Bench
    from sautereau.entrance.session import Session
    from sautereau.rig.schema import Rig


class Dated(type(Path())):
    """Default of what a command writes: a name with `DATE` in it, where the user is."""

    def today(self) -> Path:
        """Return the first name of today that nothing has, nor a recording that was cut off.

        That is press-2026-11-28, then press-2026-11-28-2.
        """
        for number in count(1):
            day = f"{date.today().isoformat()}{f'-{number}' * (number > 1)}"
            path = Path(str(self).replace("DATE", day))
            if not any(map(os.path.lexists, (path, f"{path}.part"))):
                return path
        raise AssertionError


class _Rare(Group):
    @property
    def show(self) -> bool:
        """Whether the help was asked for with `--help-all`."""
        return HELP_ALL in sys.argv


HELP_ALL = "--help-all"  # Also shows the options that few need
RARE = Parameter(group=_Rare("Further options", sort_key=50))
OutFolder = Annotated[Path, "FOLDER"]
"""The texts name the value in the message for a missing option."""
Files = Annotated[list[Path], Parameter(help="Recordings, folders of sessions, or patterns.")]
Notes = Annotated[str, Parameter(help="Operator's notes, saved in every recording.")]
RigName = Annotated[str, Parameter(help="Path of a rig file, or name of a packaged one.")]
PICTURES = (".png", ".svg", ".pdf", ".jpg", ".webp", ".eps")
"""File extensions of the plots that can be written."""


def written_as(*extensions: str) -> Parameter:
    """Return the parameter of a file that is written with one of these file extensions."""

    def check(_: object, path: Path | None) -> None:
        if path is not None and path.suffix.lower() not in extensions:
            ending = f"the file extension {path.suffix}" if path.suffix else "no file extension"
            raise ValueError(f"It has {ending}; use {', '.join(extensions)}.")

    return Parameter(validator=check)


def read_as(what: str, *extensions: str) -> Parameter:
    """Return the parameter of a file or folder that is read; one of another kind is refused.

    Args:
        what: What to give.
        extensions: Its file extensions; none for a folder. Those of no known kind are not refused.
    """

    def check(_: object, path: Path | None) -> None:
        from sautereau.rig.disk import kind_of

        if path is None or path.suffix.lower() in extensions or not path.exists():
            return
        kind = kind_of(path) or "a file" * (not extensions)
        if kind and (extensions or not path.is_dir()):
            raise ValueError(f"It is {kind}; give {what}.")

    return Parameter(validator=check)


Recording = Annotated[Path, read_as("a recording", ".mcap", ".part")]
Learned = Annotated[Path | None, read_as("the learned.json of `sautereau learn`", ".json")]
FeedForward = Annotated[
    Recording | None,
    RARE,
    Parameter(help="Recording of an earlier press; its force is compensated by torque."),
]
Folder = Annotated[Path, read_as("a folder of recordings")]


class Quantity(float):
    """A time in s that is written with its unit, as help texts show it."""

    def __str__(self) -> str:
        return f"{float(self):g} s"


def in_unit(unit: str, example: str) -> Parameter:
    """Return the parameter of a quantity, which becomes a number in a unit."""

    def convert(_: object, tokens: Sequence[Token]) -> float:
        from sautereau.rig.units import parse_quantity

        try:
            return parse_quantity(tokens[0].value, unit)
        except ValueError as error:
            raise ValueError(f'{error}; write it like "{example}"') from error

    return Parameter(converter=convert)


def _integer(_: object, tokens: Sequence[Token]) -> int:
    """Return an integer; cyclopts alone would round "2.5" to 2."""
    text = tokens[0].value
    try:
        return int(text)
    except ValueError as error:
        raise ValueError(f"{text!r} is not an integer") from error


def _check_level(_: object, level: str) -> None:
    if fault := LEVELS.unknown(level):
        raise ValueError(f"Plectrum level {fault}.")


OutFile = Annotated[Path, "FILE"]  # A file that a command writes: `run` refuses an existing one
_Plot = Annotated[OutFile | None, written_as(*PICTURES)]
Picture = Annotated[_Plot, Parameter(help="Save the plot here (.png, .svg, .pdf).")]
Drawing = Annotated[
    _Plot, Parameter(help="Save a drawing of the bench to scale here (.png, .svg, .pdf).")
]
Level = Annotated[str, Parameter(help=levels_help(), validator=_check_level)]
RareLevel = Annotated[Level, RARE]
Time = Annotated[Quantity, "QUANTITY", in_unit("s", "1.5 s")]
Duration = Annotated[Time, Parameter(validator=Range(gte=0))]
ABOVE_0 = Parameter(validator=Range(gt=0))
Integer = Annotated[int, Parameter(converter=_integer, validator=Range(gte=0))]
Count = Annotated[Integer, ABOVE_0]
Number = Annotated[Count, Parameter(name=["-n", "--number"])]
Seed = Annotated[Integer | None, Parameter(validator=Range(gte=0, lt=2**63))]


@Parameter(name="*")
@dataclass(frozen=True)
class Recorded:
    """What becomes of the presses of a session."""

    notes: Notes = ""
    warm_up: Integer = 1
    """Number of warm-up presses wherever the finger comes from above the key: at the start, after a
    pause and after each change of the instrument. They are recorded as warm-up-01.mcap and so on,
    and are no part of the results."""
    view: bool = False
    """Show arm, acquisition, force and speed in the terminal during the session."""
    live: bool = False
    """Show the session in Foxglove on this machine."""
    page: bool = False
    """Serve a page about the session to browsers on this machine; its address is printed."""


@Parameter(name="*")
@dataclass(frozen=True)
class Simulation:
    """The stand-in instead of the hardware."""

    sim: bool = False
    """Run on the stand-in instead of the hardware."""
    scene: str | None = None
    """Scene of the stand-in, by path or packaged name; implies --sim. Default: paper."""
    seed: Seed = None
    """Seed of all random numbers. Default: a new one, which the recording stores."""

    @property
    def requested(self) -> bool:
        """Whether to run on the stand-in."""
        return self.sim or self.scene is not None


@contextmanager
def options() -> Iterator[None]:
    """Report errors of the values of options as wrong usage.

    Raises:
        UsageError: Instead of another error of the project.
    """
    from sautereau.rig.errors import SautereauError, UsageError

    try:
        yield
    except SautereauError as error:
        raise UsageError(str(error)) from error


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
    from sautereau.analysis.results.rig import Rig as Own
    from sautereau.entrance import bench as benches

    if simulation.requested:
        return benches.stand_in(rig, simulation.scene or "paper", simulation.seed)
    return benches.bench(rig) if moves else benches.Bench(Own(rig))


def rig_first(
    command: str,
    first: Path,
    second: Path | None,
    is_own: Callable[[Path], bool],
    kind: str,
    output: Output,
) -> tuple[Path, str | None]:
    """Return the file of a command, and the rig before it; the other order is understood.

    Args:
        is_own: Whether a file is of the kind that the command takes.
        kind: Name of the kind: "a recording".
    """
    if second is None:
        return first, None
    if is_own(first) and not is_own(second):
        first, second = second, first
        output.warn(
            f"{second} is {kind}, {first} is a rig: give them as"
            f" `sautereau {command} {first} {second}`"
        )
    return second, str(first)


def opened(
    what: list[Path], output: Output, *, samples: bool = False
) -> "tuple[Session, list[str]]":
    """Open recordings, and read all of them.

    Args:
        what: Recordings, folders of sessions, or patterns.
        output: Shows the progress.
        samples: Whether to keep all samples.

    Returns:
        As `Session.readable`; the command reports the faults with its answer.
    """
    from sautereau.entrance.session import open

    with output.progress("reading recordings"):
        return open(what).readable(samples=samples)
