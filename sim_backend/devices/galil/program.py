"""Programs downloaded to the controller, and the threads that run them."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field

from sautereau.sim_backend.devices.galil.faults import CommandError

LINE_LENGTH = 80
"""Largest number of characters in a line of a program or of a host's command."""
LINES = 2000
"""Largest number of lines of a program."""
LABELS = 510
"""Largest number of labels of a program."""
THREADS = 8
"""Threads, numbered from 0."""
DEPTH = 16
"""Largest depth of nested subroutines."""
LINE_TIME = 250e-6
"""s, duration of any line of a program; the threads run alternately."""

_LABEL = re.compile(r"#[A-Za-z0-9]{1,7}")


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
    def parse(cls, text: str) -> "Program":
        """Parse a download: lines that end with a carriage return; blank ones are dropped.

        Raises:
            CommandError: A line is too long, a label is invalid or repeated, or there are too many.
        """
        lines = tuple(line for line in text.split("\r") if line.strip(" "))
        if len(lines) > LINES or any(len(line) > LINE_LENGTH for line in lines):
            raise CommandError(60)
        labels: dict[str, int] = {}
        for number, line in enumerate(lines):
            label = line.split(";")[0].strip(" ")
            if not label.startswith("#"):
                continue
            if not _LABEL.fullmatch(label) or label in labels:
                raise CommandError(61)
            labels[label] = number
        if len(labels) > LABELS:
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
            raise CommandError(11 if place else 10)
        return line


@dataclass(frozen=True)
class _Frame:
    """Where a thread continues after a subroutine."""

    next_line: int
    rest: tuple[str, ...]
    wait: Callable[[], bool] | None
    automatic: bool


class Thread:
    """A thread of execution; it runs one line at a time.

    A trip point (AM, WT, AI, AT) sets `wait`; the rest of its line runs in the sample in which
    that becomes true.

    Args:
        program: The program.
        line: Number of the first line.
        hosted: Whether the host started it, and not a program.
    """

    def __init__(self, program: Program, line: int, *, hosted: bool) -> None:
        self.line = line
        """Number of the present line."""
        self.running = True
        self.wait: Callable[[], bool] | None = None
        """Condition of a trip point; None where there is none."""
        self.command = ""
        """The present command."""
        self.reference = 0
        """Sample from which AT counts."""
        self._program = program
        self._next_line = line
        self._rest: list[str] = []
        self._frames: list[_Frame] = []
        self._hosted, self._looped = hosted, False

    @property
    def interrupted(self) -> bool:
        """Whether an automatic subroutine runs in it."""
        return any(frame.automatic for frame in self._frames)

    @property
    def resident(self) -> bool:
        """Whether the host started it, it loops, and no subroutine interrupts it."""
        return self._hosted and self._looped and not self.interrupted

    @property
    def waiting(self) -> bool:
        """Whether a trip point holds it."""
        return self.wait is not None and not self.wait()

    def run_line(self, execute: Callable[[str, "Thread"], None]) -> None:
        """Run one line, or its rest after a trip point, up to the next trip point.

        Args:
            execute: Carries out one command.

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

    def jump(self, place: str) -> None:
        """Continue at a label or a line."""
        line = self._program.line_of(place)
        self._looped |= line <= self.line
        self._next_line, self._rest = line, []

    def call(self, place: str) -> None:
        """Run a subroutine, then continue after the present command."""
        if len(self._frames) == DEPTH:
            raise CommandError(12)
        line = self._program.line_of(place)
        self._push(line, automatic=False)

    def interrupt(self, place: str) -> bool:
        """Run an automatic subroutine, if the program has it and none runs already."""
        if self.interrupted or place not in self._program.labels:
            return False
        self._push(self._program.labels[place], automatic=True)
        return True

    def end(self) -> None:
        """Return from a subroutine, or end the thread."""
        if not self._frames:
            self.running = False
        else:
            self._pop(keep_trip_point=True)

    def end_interrupt(self, *, keep_trip_point: bool) -> None:
        """Return from an automatic subroutine.

        Raises:
            CommandError: None runs.
        """
        if not self._frames or not self._frames[-1].automatic:
            raise CommandError(8)
        self._pop(keep_trip_point)

    def skip(self, *ends: str) -> None:
        """Continue after the ELSE or ENDIF that belongs to the present IF or ELSE."""
        depth = 0
        while True:
            while not self._rest:
                self._fetch()
            command = self._rest.pop(0)
            if depth == 0 and command in ends:
                return
            if command.startswith("IF"):
                depth += 1
            elif command == "ENDIF":
                depth -= 1

    def _push(self, line: int, *, automatic: bool) -> None:
        self._frames.append(_Frame(self._next_line, tuple(self._rest), self.wait, automatic))
        self._next_line, self._rest, self.wait = line, [], None

    def _pop(self, keep_trip_point: bool) -> None:
        frame = self._frames.pop()
        self._next_line, self._rest = frame.next_line, list(frame.rest)
        self.wait = frame.wait if keep_trip_point else None

    def _fetch(self) -> None:
        self.line = self._next_line
        self.command = ""
        if self.line >= len(self._program.lines):
            raise CommandError(10)
        self._next_line = self.line + 1
        self._rest = split_commands(self._program.lines[self.line])
