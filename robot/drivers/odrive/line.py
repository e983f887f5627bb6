"""The line to an ODrive: ASCII lines out, each with its checksum; answers only to questions.

The controller ignores a line with a wrong checksum, so a corrupted line moves nothing. It
answers a line that asks nothing only to refuse it.
"""

import math
import threading
from collections.abc import Iterable
from functools import reduce
from operator import xor

from sautereau.robot.drivers.serial_port import Port, Wire
from sautereau.robot.errors import (
    GarbledAnswer,
    RobotError,
    SettingNotTaken,
    SilentController,
    UnaskedText,
)

_REFUSALS = (
    "invalid command format",
    "invalid motor",
    "invalid property",
    "not implemented",
    "unknown command",
)
_QUESTION = "r vbus_voltage"  # Asked to confirm the commands before it; any question would do
_QUESTIONS = 4
"""Questions in one write: about 200 characters, as many as a row of setpoints with its questions,
which the controller's input buffer holds."""
_LAST = "Serial number:"  # Begins the last line with which the controller identifies itself


class LineRefused(RobotError):  # noqa: N818 - the name says what happened
    """The controller does not know a command, property or axis, or does not take the value."""


class OdriveLine(Wire):
    """Send commands and questions from several threads; each thread gets its own answers.

    Arguments as for `Wire`.
    """

    def __init__(self, port: Port, name: str, timeout: float, first_wait: float | None = None):
        super().__init__(port, name, timeout, first_wait)
        self._lock = threading.RLock()
        self._received = b""

    def _alone(self) -> threading.RLock:
        return self._lock

    def _freshen(self) -> None:
        self.resynchronise()

    def confirmed(self, *commands: str) -> None:
        """Send commands that answer nothing, and make sure that they were received.

        Raises:
            RobotError: See `ask`.
        """
        self.ask(*commands, _QUESTION)

    def ask(self, *commands: str, answers: int = 1) -> list[str]:
        """Send commands in one write, and return ``answers`` lines of answers.

        Raises:
            LineRefused: The firmware refuses a command.
            SilentController: No byte came within the timeout.
            GarbledAnswer: Bytes that no ODrive sends, or that were not asked for.
            LineLost: The port has gone away.
        """
        asked = "; ".join(commands)
        with self._lock, self._reaching(asked):
            try:
                if answers:
                    self._refuse_unasked(asked)
                self._port.write("".join(map(framed, commands)).encode("ascii"))
                return [self._answer(asked) for _ in range(answers)]
            except (GarbledAnswer, LineRefused):
                self._discard()  # what follows belongs to this exchange
                raise

    def read(self, name: str) -> float:
        """Return the value of a property such as `axis0.error`."""
        return self.read_many([name])[name]

    def query(self, *questions: str, count: int = 1) -> list[list[float]]:
        """Return the numbers, ``count`` to an answer, of questions in one write."""

        def ask() -> list[list[float]]:
            return self.numbers(questions, self.ask(*questions, answers=len(questions)), count)

        return self.reading(ask)

    def numbers(
        self, questions: Iterable[str], answers: Iterable[str], count: int
    ) -> list[list[float]]:
        """Return the numbers of answers, ``count`` to each."""
        return [
            self.parsed(question, text, count)
            for question, text in zip(questions, answers, strict=True)
        ]

    def parsed(self, command: str, text: str, count: int) -> list[float]:
        """Return the numbers of an answer; refuse another number of them."""
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) != count or any(map(math.isnan, values)):
            raise self.garbled(command, text, f"{count} numbers were expected")
        return values

    def read_many(self, names: Iterable[str]) -> dict[str, float]:
        """Return the values of properties by name, several to a write."""
        names = list(names)
        asked = [f"r {name}" for name in names]
        some = [asked[at : at + _QUESTIONS] for at in range(0, len(asked), _QUESTIONS)]
        values = [value for each in some for (value,) in self.query(*each)]
        return dict(zip(names, values, strict=True))

    def set(self, settings: dict[str, float]) -> None:
        """Write properties, read each back, and list all that were not taken in one error."""
        faults = []
        for name, value in settings.items():
            (text,) = self.ask(f"w {name} {value:.9g}", f"r {name}")
            (taken,) = self.parsed(f"r {name}", text, 1)
            if not same(taken, value):
                faults.append(f"{name} is {taken:g} and should be {value:g}")
        self.refuse(faults)

    def refuse(self, faults: list[str]) -> None:
        """Refuse a controller if its settings have faults."""
        if faults:
            raise SettingNotTaken(
                f"controller on {self.name} did not take its settings: {', '.join(faults)};"
                " compare the rig file with the controller's configuration in odrivetool"
            )

    def resynchronise(self, *commands: str) -> list[str]:
        """End a broken-off line, send commands, and skip all answers before the identification.

        The end of an empty line is refused like an unknown command, and late answers may be
        under way: only the identification cannot be taken for one of them.

        Returns:
            Hardware version, firmware version and serial number, as the controller sends them.

        Raises:
            RobotError: As `ask`; `GarbledAnswer` where it does not identify itself.
        """
        lines: list[str] = []
        with self._lock, self._reaching("i"):
            self._discard()
            self._port.write(("\n" + "".join(map(framed, (*commands, "i")))).encode("ascii"))
            try:
                while not (len(lines) > 2 and lines[-1].startswith(_LAST)):
                    if sum(map(len, lines)) > 4096:  # The controller's own buffer holds 512
                        raise self.garbled("i", lines[0], "it does not end")
                    text, valid = self._line("i")
                    lines.append(text if valid else "")
            except SilentController:
                if not any(lines):
                    raise
                said = "; ".join(filter(None, lines))
                why = "an ODrive 3.x gives its hardware version"
                raise self.garbled("i", said, why) from None
        return lines[-3:]

    def _discard(self) -> None:
        self._received = b""
        self._port.reset_input_buffer()

    def _refuse_unasked(self, asked: str) -> None:
        early = self._received + self._waiting()
        self._received = b""
        if early:
            raise UnaskedText(
                f"controller on {self.name} sent {early[:60]!r} before it was asked {asked!r}: it"
                " refused an earlier line, or another program shares the port; end that program,"
                " check the firmware's version, then connect() again"
            )

    def _line(self, asked: str) -> tuple[str, bool]:
        """Return the next line without its checksum, and whether that is right."""
        while b"\n" not in self._received:
            if not (data := self._read()):
                raise self._silence(asked, repr(self._received) if self._received else "")
            self._received += data
            # The firmware cuts an answer to 64.
            if len(self._received) > 64 and b"\n" not in self._received:
                raise self.garbled(asked, self._received, "it is longer than any answer")
        received, _, self._received = self._received.partition(b"\n")
        text, star, sent = received.decode("latin-1").strip().rpartition("*")
        valid = bool(star) and sent == str(checksum(text))
        return (text if valid else received.decode("latin-1").strip()), valid

    def _answer(self, asked: str) -> str:
        text, valid = self._line(asked)
        if not valid:
            raise self.garbled(asked, text, "its checksum is missing or wrong")
        if text.startswith(_REFUSALS):
            raise LineRefused(
                f"controller on {self.name} refused {asked!r}: {text}; this driver is for"
                " firmware 0.5.6: update the controller's, or correct the rig file"
            )
        return text

    def garbled(self, asked: str, text: str | bytes, why: str) -> GarbledAnswer:
        return GarbledAnswer(
            f"controller on {self.name} answered {asked!r} with {text[:60]!r}: {why}; check"
            " controller.baud_rate and that controller.port is the ODrive"
        )


def same(read: float, due: float) -> bool:
    """Return whether a value that was read is the one that is due.

    An answer is cut to nine characters, of which six are decimals.
    """
    return math.isclose(read, due, rel_tol=1e-5, abs_tol=2e-6)


def checksum(text: str) -> int:
    """Return the exclusive or of a line's bytes."""
    return reduce(xor, text.encode("latin-1"), 0)


def framed(command: str) -> str:
    """Return a command as it is sent, with its checksum."""
    return f"{command}*{checksum(command)}\n"
