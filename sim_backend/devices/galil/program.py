"""Programs downloaded to the controller."""

import re
from dataclasses import dataclass, field

from sautereau.sim_backend.devices.galil.faults import CommandError

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
