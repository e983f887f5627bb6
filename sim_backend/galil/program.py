"""Programs downloaded into the controller, and the threads that run them."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field

from sim_backend.galil.faults import CommandError

LINE_LENGTH = 80
"""Characters that a line may have, of a program as of a host's command."""
LINES = 2000
"""Lines that a program may have."""
LABELS = 510
"""Labels that a program may have."""
THREADS = 8
"""Threads, numbered from 0."""

_LABEL = re.compile(r"#[A-Za-z0-9]{1,7}")


def split_commands(line: str) -> list[str]:
    """Split a line at the semicolons outside strings; blanks around a command go."""
    parts = re.findall(r'(?:"[^"]*"|[^;"]|")+', line)
    return [part.strip(" ") for part in parts if part.strip(" ")]


@dataclass(frozen=True)
class Program:
    """Lines and where their labels stand."""

    lines: tuple[str, ...] = ()
    labels: dict[str, int] = field(default_factory=dict)
    """Line number of each ``#LABEL``."""

    @classmethod
    def parse(cls, text: str) -> "Program":
        """Read a download: lines that end with a carriage return; blank ones are dropped.

        Raises:
            CommandError: A line is too long, a label bad or twice there, or there are too many.
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
        """Return the line number of a ``#LABEL``, of a line's number, or of nothing: 0.

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


class Thread:
    """One strand of execution: at most one line a sample, and a line in one go.

    A trip point (AM, WT, AI) sets `wait`; the rest of its line runs in the sample in
    which that becomes true. Jumps will set `next_line`.

    Args:
        program: What it runs.
        line: Number of the first line.
    """

    def __init__(self, program: Program, line: int) -> None:
        self.line = line
        """Number of the line under way."""
        self.next_line = line
        self.running = True
        self.wait: Callable[[], bool] | None = None
        """What a trip point waits for."""
        self.command = ""
        """The command under way."""
        self._program = program
        self._rest: list[str] = []

    def tick(self, execute: Callable[[str, "Thread"], None]) -> None:
        """Run one line, or what is left of it, as far as its trip points allow.

        Args:
            execute: Carries out one command.

        Raises:
            CommandError: The program has come to its end without EN.
        """
        if self.wait is None:
            self._fetch()
        while self.running:
            if self.wait is not None:
                if not self.wait():
                    return
                self.wait = None
            if not self._rest:
                return
            self.command = self._rest.pop(0)
            execute(self.command, self)

    def _fetch(self) -> None:
        self.line = self.next_line
        self.command = ""
        if self.line >= len(self._program.lines):
            raise CommandError(10)
        self.next_line = self.line + 1
        self._rest = split_commands(self._program.lines[self.line])
