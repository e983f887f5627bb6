"""Programs downloaded to the controller, and the threads that run them."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field

from sautereau.sim_backend.devices.galil.answers import CommandError

_LABEL = re.compile(r"#[A-Za-z][A-Za-z0-9]{0,6}")


@dataclass(frozen=True)
class Limits:
    """What the controller's memory holds."""

    lines: int = 4000
    labels: int = 510
    variables: int = 510
    elements: int = 24_000
    """Elements of all arrays together."""
    line_length: int = 80
    """Characters in a line of a program or of a command."""


def split_commands(line: str) -> list[str]:
    """Split a line at the semicolons outside strings; blanks around a command are dropped."""
    parts = re.findall(r'(?:"[^"]*"|[^;"]|")+', line)
    return [part.strip(" ") for part in parts if part.strip(" ")]


@dataclass(frozen=True)
class Program:
    """Lines, and the positions of their labels."""

    lines: tuple[str, ...] = ()
    labels: dict[str, int] = field(default_factory=dict)
    """Line number of each ``#LABEL``."""

    @classmethod
    def parse(cls, text: str, limits: Limits) -> "Program":
        """Parse a download: lines that end with a carriage return; blank ones are dropped.

        Args:
            text: Of all lines.
            limits: Of the controller's memory.

        Raises:
            CommandError: A line is too long, a label is invalid or repeated, or there are too many.
        """
        lines = tuple(line for line in text.split("\r") if line.strip(" "))
        longest = max(map(len, lines), default=0)
        if len(lines) > limits.lines or longest > limits.line_length:
            raise CommandError(60)
        labels: dict[str, int] = {}
        for number, line in enumerate(lines):
            label = line.split(";")[0].rstrip(" ")
            if not label.startswith("#"):
                continue
            if not _LABEL.fullmatch(label) or label in labels:
                raise CommandError(61)
            labels[label] = number
        if len(labels) > limits.labels:
            raise CommandError(62)
        return cls(lines, labels)

    def line_of(self, place: str) -> int:
        """Return the line number of a ``#LABEL`` or of a number; 0 for an empty text.

        Raises:
            CommandError: There is no such label or line.
        """
        if place.startswith("#"):
            if place not in self.labels:
                raise CommandError(10)
            return self.labels[place]
        if place and not re.fullmatch(r"[0-9]{1,4}", place):
            raise CommandError(11)
        line = int(place or 0)
        if line >= len(self.lines):
            raise CommandError(10)
        return line


ERROR_ROUTINES = ("#POSERR", "#LIMSWI", "#AMPERR", "#TCPERR")
"""Automatic subroutines that RE ends; the others are ended by EN."""


@dataclass(frozen=True)
class _Frame:
    """Where a thread continues after a subroutine."""

    next_line: int
    rest: tuple[str, ...]
    wait: Callable[[], bool] | None
    routine: str
    """Label of an automatic subroutine; empty for one that JS called."""


class Thread:
    """A thread of execution; it runs one line at a time.

    A trip point (AM, WT, AI, AT, MC) sets `wait`; the rest of its line runs as soon as that is
    true.

    Args:
        line: Number of the first line.
        hosted: Whether the host started it, and not a program.
        routine: Label of the automatic subroutine for which it was started, if it was.
    """

    def __init__(self, program: Program, line: int, *, hosted: bool, routine: str = "") -> None:
        self.line = line
        """Number of the present line."""
        self.running = True
        self.wait: Callable[[], bool] | None = None
        """Condition of a trip point; None where there is none."""
        self.command = ""
        """The present command."""
        self.reference = 0
        """Sample from which AT counts."""
        self.stuck = False
        """Whether EN ended a subroutine that only RE ends: it does not run again before ZS."""
        self._program = program
        self._next_line = line
        self._rest: list[str] = []
        self._frames: list[_Frame] = []
        self._hosted, self._base = hosted, routine
        self._visited: set[int] = set()
        self.looped = False
        """Whether a line runs again, since the start or the last interruption."""

    @property
    def routines(self) -> tuple[str, ...]:
        """Labels of the automatic subroutines that run in it, the innermost last."""
        frames = [frame.routine for frame in self._frames]
        return tuple(name for name in (self._base, *frames) if name)

    @property
    def depth(self) -> int:
        """Levels of its stack of subroutines."""
        return len(self._frames)

    @property
    def resident(self) -> bool:
        """Whether it loops, and waits for the host or in an automatic subroutine."""
        return self.looped and (self._hosted or bool(self.routines))

    @property
    def waiting(self) -> bool:
        """Whether a trip point holds it."""
        return self.wait is not None and not self.wait()

    def run_line(self, execute: Callable[[str, "Thread"], None]) -> None:
        """Run one line, or its rest after a trip point, up to the next trip point.

        Raises:
            CommandError: The program ends without EN.
        """
        if self.wait is None and not self._rest:
            self._fetch()
        while self.running:
            if self.waiting:
                return
            self.wait = None
            if not self._rest:
                return
            self.command = self._rest.pop(0)
            execute(self.command, self)

    def jump(self, line: int) -> None:
        """Continue at a line."""
        self.looped |= line in self._visited
        self._next_line, self._rest = line, []

    def call(self, line: int, routine: str = "") -> None:
        """Run a subroutine, then continue after the present command.

        Args:
            line: Number of its first line.
            routine: Its label, if it is an automatic one.

        Raises:
            CommandError: There are too many levels.
        """
        if len(self._frames) == 16:  # Nested subroutines
            raise CommandError(12)
        self._frames.append(_Frame(self._next_line, tuple(self._rest), self.wait, routine))
        self._next_line, self._rest, self.wait = line, [], None
        if routine:
            self._visited, self.looped = set(), False

    def end(self, *, keep_trip_point: bool) -> None:
        """EN: return from a subroutine, or end the thread."""
        inner = self._frames[-1].routine if self._frames else self._base
        self.stuck |= inner in ERROR_ROUTINES
        self._return(keep_trip_point or not inner)

    def end_error(self, *, keep_trip_point: bool) -> None:
        """RE: return from an automatic subroutine of an error.

        Raises:
            CommandError: None runs.
        """
        inner = self._frames[-1].routine if self._frames else self._base
        if inner not in ERROR_ROUTINES:
            raise CommandError(8)
        self._return(keep_trip_point)

    def clear_stack(self, levels: int) -> None:
        """ZS: forget where the innermost subroutines return to."""
        if levels >= len(self._frames):
            self._base = ""
        del self._frames[len(self._frames) - min(levels, len(self._frames)) :]
        self.stuck = False

    def skip(self, *ends: str) -> None:
        """Continue after the ELSE or ENDIF that belongs to the present IF or ELSE.

        Raises:
            CommandError: There is none.
        """
        depth = 0
        while True:
            while not self._rest:
                if self._next_line >= len(self._program.lines):
                    raise CommandError(63)
                self._fetch()
            command = self._rest.pop(0)
            if depth == 0 and command in ends:
                return
            if command.startswith("IF"):
                depth += 1
            elif command == "ENDIF":
                depth -= 1

    def _return(self, keep_trip_point: bool) -> None:
        if not self._frames:
            self.running = False
            return
        frame = self._frames.pop()
        self._next_line, self._rest = frame.next_line, list(frame.rest)
        self.wait = frame.wait if keep_trip_point else None

    def _fetch(self) -> None:
        self.line = self._next_line
        self.command = ""
        if self.line >= len(self._program.lines):
            raise CommandError(10)
        self._next_line = self.line + 1
        self._visited.add(self.line)
        self._rest = split_commands(self._program.lines[self.line])
