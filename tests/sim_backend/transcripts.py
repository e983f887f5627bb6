"""Dialogues of a command reference as text, and a terminal that replays them.

A line `== heading @offset` starts a dialogue on a controller that was reset. Its other lines:

| line | meaning |
|---|---|
| `sent` | accepted, without an answer |
| `sent => answer` | answers that text; ` / ` stands for a new line, ^Z for control-Z |
| `sent #> answer` | answers these characters exactly, written with \\r and \\n |
| `sent ~> 1, 2 +- 0.1` | answers these numbers, each up to the tolerance |
| `sent !> 6` | is refused with that error code, `?` for unread and `*` for any |
| `| line` | a line of a program, which is downloaded when all are read |
| `<= text`, `<~ 1, 2` | the program then sends that text, or these numbers |
| `<? 3` | the program then stops with that error code |
| `{slip 1 100}` | the encoder of joint 1 counts 100 more, as when moved by hand |
"""

import re
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

DEADLINE = 60.0  # s of real time for an answer
_NUMBER = r"[-+]?\d+(?:\.\d*)?|[-+]?\.\d+"


@dataclass(frozen=True)
class Dialogue:
    """What is sent, and what is answered, in the order of time."""

    heading: str
    offset: int
    lines: tuple[str, ...]


def read_dialogues(path: Path) -> list[Dialogue]:
    """Return the dialogues of a file."""
    found: list[Dialogue] = []
    for block in path.read_text(encoding="utf-8").split("== ")[1:]:
        first, *lines = block.splitlines()
        heading, offset = first.rsplit(" @", 1)
        found.append(Dialogue(heading, int(offset), tuple(line for line in lines if line)))
    return found


class Terminal:
    """A host at a controller's port, which reads what it is sent byte by byte.

    Args:
        port: Opened by pyserial, with a short timeout.
        bench: The simulated bench, for what is done by hand.
    """

    def __init__(self, port: Any, bench: Any) -> None:
        self._port, self._bench, self._unread = port, bench, ""

    def reset(self) -> None:
        """Give the controller its state after power-up, without echo."""
        for line in ("HX;AB", "RS", "EO 0"):
            self._write(line)
            self._until(r"[:?]$")
        self._write('MG "ready"')
        self._until(r"ready\r\n:")
        self._unread = ""

    def replay(self, dialogue: Dialogue) -> None:
        """Send a dialogue's lines, and check all answers."""
        program: list[str] = []
        for line in (*dialogue.lines, ""):
            if line.startswith("| "):
                program.append(line[2:])
                continue
            if program:
                assert self.ask("\r".join(["DL", *program, "\\"])) == "", "download refused"
                program = []
            if line:
                self._step(line)

    def ask(self, sent: str, echo: bool = False) -> str:
        """Send a line and return its answer without prompts; a final `?` says it was refused.

        The line itself, if echoed, is part of the answer with ``echo``.
        """
        single = sent.startswith(("DL", "QD", "^"))
        commands = 1 if single else len(_outside(sent).split(";"))
        self._write(sent)
        answer = self._until(rf"\?$|(?:[^:]*:){{{commands}}}").replace(":", "")
        return answer if echo else answer.removeprefix(sent + "\r")

    def _step(self, line: str) -> None:
        if line.startswith("{slip "):
            joint, counts = map(int, line[6:-1].split())
            self._bench.operate(lambda plant: plant.slip(joint, counts))
        elif line.startswith("<? "):
            self._until(r"\?[^\n]*\r\n")
            assert self._code() == int(line[3:])
        elif line.startswith("<"):
            message = self._until(r"\r\n")
            (_plain if line[1] == "=" else _numbers)(line, message, line[3:])
        elif match := re.fullmatch(r"(.*?) ?([=#~!])>(.*)", line):
            sent, kind, expected = match.groups()
            getattr(self, {"=": "_text", "#": "_exact", "~": "_values", "!": "_refused"}[kind])(
                sent, expected.removeprefix(" ") if kind == "#" else expected.strip()
            )
        else:
            _plain(line, self.ask(line), "")

    def _text(self, sent: str, expected: str) -> None:
        _plain(sent, self.ask(sent), expected)

    def _exact(self, sent: str, expected: str) -> None:
        wanted = expected.encode().decode("unicode_escape")
        answer = self.ask(sent, echo=True)
        assert answer == wanted, f"{sent!r} answered {answer!r}, not {wanted!r}"

    def _values(self, sent: str, expected: str) -> None:
        _numbers(sent, self.ask(sent), expected)

    def _refused(self, sent: str, expected: str) -> None:
        answer = self.ask(sent)
        assert answer.endswith("?"), f"{sent!r} answered {answer!r}, and is not refused"
        if expected != "?":
            code = self._code()
            assert expected in ("*", str(code)), f"{sent!r}: code {code}, not {expected}"

    def _code(self) -> int:
        return int(self.ask("TC0"))

    def _write(self, line: str) -> None:
        if line.startswith(("^R", "^L")):
            line = re.sub(r"\^([A-Z])", lambda each: chr(ord(each[1]) - 64), line)
        self._port.write(line.replace("\\r", "\r").replace("\\\\", "\\").encode("latin-1") + b"\r")

    def _until(self, pattern: str) -> str:
        latest = time.monotonic() + DEADLINE
        while not (match := re.search(pattern, self._unread)):
            assert time.monotonic() < latest, f"no {pattern!r} in {self._unread!r}"
            self._unread += self._port.read(max(1, self._port.in_waiting)).decode("latin-1")
        read, self._unread = self._unread[: match.end()], self._unread[match.end() :]
        return read


def _outside(text: str) -> str:
    """Return a line without strings and without the text of its comment, which is a command."""
    return re.sub(r'"[^"]*"|(?<=\').*', "", text).rstrip(";")


def _plain(sent: str, answer: str, expected: str) -> None:
    lines = [
        " ".join(line.split()).replace(", ", ",") for line in re.split("\r\n?", answer.strip())
    ]
    found = " / ".join(line.replace("\x1a", "^Z") for line in lines)
    assert found == expected.replace(", ", ","), f"{sent!r} answered {answer!r}, not {expected!r}"


def _numbers(sent: str, answer: str, expected: str) -> None:
    values, _, tolerance = expected.partition("+-")
    wanted = [float(each) for each in re.findall(_NUMBER, values)]
    found = [float(each) for each in re.findall(_NUMBER, answer)]
    near = [abs(a - b) <= float(tolerance or 1e-9) for a, b in zip(found, wanted, strict=False)]
    assert len(near) == len(found) == len(wanted), f"{sent!r} answered {answer!r}, not {expected}"
    assert all(near), f"{sent!r} answered {answer!r}, not {expected}"
