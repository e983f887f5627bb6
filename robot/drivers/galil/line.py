"""The request/answer line of a Galil controller: commands out, `:` or `?` back.

With its echo on, the controller repeats each command, and the line compares it with what was sent:
this detects every corrupted byte. Only a serial port has an echo. Ethernet has checksums, and the
values that the controller accepted are read back. In messages of a program in the controller, the
most significant bit of every byte is set (CW 1), which separates them from answers.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager, suppress
from functools import partial
from math import isfinite

from sautereau.robot.drivers.galil.dmc import LONGEST_LINE, pack, pieces
from sautereau.robot.drivers.keep_alive import FairLock
from sautereau.robot.drivers.serial_port import Port, Wire
from sautereau.robot.errors import (
    CommandRefused,
    GarbledAnswer,
    LineLost,
    RobotError,
    SettingNotTaken,
    UnaskedText,
)

_LONGEST_ANSWER = 1 << 18
_SPACES = b"\t\n\r\x1a"  # Control characters of answers; control-Z follows an uploaded array
_NOISE = 3  # Bytes of noise, at most: before an echo, or with their most significant bit set
_END = "\x1a\r\n "
_MARK = "4711"
_MARKED = re.compile(rf"{_MARK}(?:\.0*)?((?: +-?[0-9.]+)*)\s*:$")


class Line(Wire):
    """Ask one thing at a time and read exactly its answer; threads share the line.

    Arguments as for `Wire`.
    """

    def __init__(self, port: Port, name: str, timeout: float, first_wait: float | None = None):
        super().__init__(port, name, timeout, first_wait)
        self.echo = False
        """Whether the controller repeats what it receives, and the host compares it."""
        self.piece = 1 << 16
        """Largest number of elements of an array in one upload."""
        self._lock = FairLock()

    def _alone(self) -> AbstractContextManager[None]:
        return self._lock.command()

    def _freshen(self) -> None:
        """Discard late answers: those that come before the answer to a number of our own."""
        self.resynchronise()
        self._send("")  # ends a question whose own end was lost
        self._after_mark(())

    def ask(self, *commands: str, keep_waiting: Callable[[], bool] | None = None) -> str:
        """Send commands on one line and return the text that they answer.

        Args:
            keep_waiting: For the keep-alive: returns after each timeout whether to wait longer
                for the answer. The wait ends early if another command waits for the line.

        Raises:
            CommandRefused: With the code and text of `TC1`.
            SilentController: No byte came within the timeout.
            GarbledAnswer: Bytes that no controller sends, or that nobody asked for, or the
                controller received something else than was sent.
            LineLost: The port has gone away.
        """
        with self._lock.command() if keep_waiting is None else self._lock.keep_alive():
            with self._reaching("listen"):
                early = self._waiting()
            if early:
                self.resynchronise()
                text = bytes(byte & 127 for byte in early)
                raise UnaskedText(
                    f"controller on {self.name} sent {text!r} before it was asked"
                    f" {';'.join(commands)!r}: its program failed, or another program shares the"
                    " line; look the message up, then connect() again"
                )
            self._send(";".join(commands))
            return self._answer(commands, keep_waiting)

    def numbers(
        self, *commands: str, count: int, keep_waiting: Callable[[], bool] | None = None
    ) -> list[float]:
        """Return the numbers that a query answers; refuse another number of them than ``count``.

        Args:
            commands: The query, and others that answer nothing, on one line.
            count: Of the numbers.
            keep_waiting: As for `ask`.
        """
        text = self.ask(*commands, keep_waiting=keep_waiting)
        return self._numbers(text, commands[0], count)

    def _numbers(self, text: str, command: str, count: int) -> list[float]:
        try:
            values = [float(word) for word in text.replace(",", " ").split()]
        except ValueError:
            values = []
        if len(values) != count or not all(map(isfinite, values)):
            raise GarbledAnswer(
                f"controller on {self.name} answered {command!r} with {_short(text)}, where"
                f" {count} numbers were expected; check the baud rate and the firmware's revision"
            )
        return values

    def read(self, *operands: str) -> list[float]:
        """Return the values of operands such as `_TPA`."""
        question = f"MG {','.join(operands)}"
        return self.reading(lambda: self.numbers(question, count=len(operands)))

    def listing(self) -> list[str]:
        """Return the lines of the controller's program, each with its number."""
        return self.reading(lambda: self.ask("LS")).split("\r\n")

    def read_many(self, operands: Iterable[str]) -> list[float]:
        """Return the values of any number of operands, as many at a time as a line can ask for."""
        question = LONGEST_LINE - len("MG ")
        return [value for names in pack(operands, question) for value in self.read(*names)]

    def upload(self, array: str, rows: int) -> list[float]:
        """Return an array of the controller, in pieces between which others can use the line.

        Args:
            rows: Its size, at least 2.
        """
        values: list[float] = []
        for first, last in pieces(rows, self.piece):
            values += self.reading(partial(self._elements, array, first, last))
        return values

    def _elements(self, array: str, first: int, last: int) -> list[float]:
        command = f"QU {array}[],{first},{last},1"
        return self._numbers(self.ask(command).rstrip(_END), command, last - first + 1)

    def verify(self, settings: Mapping[str, float], tolerance: float = 0.0) -> None:
        """Read operands back, and refuse a controller that has not taken their values."""
        values = self.read(*settings)
        faults = [
            f"{name} is {value:g} and should be {due:g}"
            for (name, due), value in zip(settings.items(), values, strict=True)
            if abs(value - due) > tolerance
        ]
        if faults:
            raise SettingNotTaken(
                f"controller on {self.name} did not take its settings: {', '.join(faults)}; compare"
                " the rig file with the controller's manual"
            )

    def ask_packed(self, commands: Iterable[str]) -> None:
        """Send commands that answer nothing, as many on a line as it holds."""
        for line in pack(commands):
            self.ask(*line)

    def send_unacknowledged(self, *commands: str) -> None:
        """Send commands, one per line; answers and a lost line are ignored."""
        with self._lock.held(), suppress(LineLost):
            for command in commands:
                self._send(command)

    def send_unchecked(self, commands: Iterable[str], *operands: str) -> list[float]:
        """Send commands, a line each, ignore their answers, and return operands read after them.

        Use it for an unreliable line when there is no time to wait for each answer.
        """
        with self._lock.command_despite_silence():
            self.resynchronise()
            for command in commands:
                self._send(command)
            return self._after_mark(operands)[0]

    def _after_mark(self, operands: tuple[str, ...]) -> tuple[list[float], str]:
        """Ask for `_MARK` and operands; return the operands, and everything received."""
        self._send(f"MG {','.join((_MARK, *operands))}")
        received = ""
        while True:
            received += self._more(_MARK, received)
            if (found := _MARKED.search(received)) and len(found[1].split()) == len(operands):
                return [float(word) for word in found[1].split()], received

    def download(self, program: Iterable[str]) -> None:
        """Replace the controller's program.

        The number of `:` that a download answers differs between firmwares, so a number of our
        own is asked for after it: everything before that number answers the download. Then the
        program is listed and compared.

        Raises:
            SettingNotTaken: The controller holds another program.
        """
        program = list(program)
        with self._lock.command():
            for text in ("DL", *program, "\\"):
                self._send(text)
            _, answer = self._after_mark(())
            if "?" in answer:
                self._refuse("DL")
        # A listed line has its number, its text and a blank.
        held = [line.strip().partition(" ")[2] for line in self.listing()]
        if held != program:
            raise SettingNotTaken(
                f"controller on {self.name} holds another program than was sent:"
                f" {_short(str(held))}; connect() again, and check the cable's shield"
            )

    def report(self, error: RobotError) -> None:
        """Raise an error, found by the keep-alive, at the next command."""
        self._lock.report(error)

    def resynchronise(self) -> None:
        """Discard the bytes received so far."""
        with self._reaching("reset"):
            self._port.reset_input_buffer()

    def _send(self, text: str) -> None:
        with self._reaching(text):
            self._port.write(f"{text}\r".encode("ascii"))

    def _answer(
        self, commands: tuple[str, ...], keep_waiting: Callable[[], bool] | None = None
    ) -> str:
        sent, received = ";".join(commands), ""
        while received.count(":") < len(commands):
            received += self._more(sent, received, keep_waiting)
            if "?" in received:
                done = self._after_echo(sent, received.partition("?")[0]).count(":")
                if done < len(commands):
                    self._refuse(commands[done])
                break
        answer = self._after_echo(sent, received)
        if not answer.endswith(":") or answer.count(":") != len(commands):
            raise GarbledAnswer(
                f"controller on {self.name} answered {sent!r} with"
                f" {_short(received)}, more than was asked; check that no other program shares"
                " the line, then connect() again"
            )
        return answer.replace(":", "").strip()

    def _after_echo(self, sent: str, received: str) -> str:
        """Return the text after the echo of the commands."""
        if not self.echo:
            return received
        echo, answer = received[: len(sent)], received[len(sent) :]
        if echo != sent or not answer.startswith("\r"):
            self.resynchronise()
            line = received.partition("\r")[0]
            echoed = f"controller on {self.name} was sent {_short(sent)} and echoed {_short(line)}"
            if received.find(sent) >= _NOISE:  # a command, and not noise, came in between
                raise UnaskedText(
                    f"{echoed}: another program shares the line; end it, then connect() again"
                )
            raise GarbledAnswer(f"{echoed}; check the cable's shield and controller.baud_rate")
        return answer

    def _more(
        self, asked: str, received: str, keep_waiting: Callable[[], bool] | None = None
    ) -> str:
        """Return at least one character more of an answer."""
        while True:
            needed = self._lock.command_waits
            with self._reaching(asked):
                data = self._read()
            if data or needed or keep_waiting is None or not keep_waiting():
                break
        if not data:
            raise self._silence(asked, _short(received) if received else "")
        if any(byte > 127 for byte in data):
            data += self._waiting()
        message = bytes(byte & 127 for byte in data if byte > 127).strip()
        if len(message) > _NOISE and message.isascii() and message.decode().isprintable():
            self.resynchronise()
            raise UnaskedText(
                f"controller on {self.name} sent {message[:60]!r} by itself while it was asked"
                f" {asked!r}: its program failed, or another is running in it; look the message"
                " up, then connect() again"
            )
        if any(byte > 126 or (byte < 32 and byte not in _SPACES) for byte in data):
            self.resynchronise()
            raise GarbledAnswer(
                f"controller on {self.name} answered {asked!r} with {data[:40]!r}, which is no"
                " text; check controller.baud_rate and that controller.port is the controller"
            )
        if len(received) + len(data) > _LONGEST_ANSWER:
            raise GarbledAnswer(
                f"controller on {self.name} answers {asked!r} with more than"
                f" {_LONGEST_ANSWER} characters; check that controller.port is the controller"
            )
        return data.decode("ascii")

    def _refuse(self, command: str) -> None:
        answer = "?"
        if command != "TC1":
            self._send("TC1")
            answer = self._answer(("TC1",)).removeprefix("TC1").strip()  # the echo may be on
        code, _, text = answer.partition(" ")
        if not code.isdigit() or not int(code):  # 0: nothing was refused
            raise GarbledAnswer(
                f"controller on {self.name} refused {command!r} and gave {_short(answer)}, not the"
                " code and text of TC1; check the firmware's revision"
            )
        raise CommandRefused(self.name, command, int(code), text.strip())


def _short(text: str) -> str:
    return repr(text if len(text) <= 60 else f"{text[:57]}...")
