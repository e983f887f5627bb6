"""The request/answer line of a Galil controller: commands out, `:` or `?` back.

With its echo on, the controller repeats what it has received, and every command is compared
with that: a corrupted byte is always noticed.
"""

import re
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress

from sautereau.robot.drivers.serial_port import Port, Wire
from sautereau.robot.errors import (
    CommandRefused,
    GarbledAnswer,
    LineLost,
    SettingNotTaken,
    SilentController,
)

LONGEST_LINE = 79
"""Characters of one command line, without its carriage return."""
_LONGEST_ANSWER = 1 << 18
_MARK = "4711"
_MARKED = re.compile(rf"{_MARK}(?:\.0*)?((?: +-?[0-9.]+)*)\s*:$")


class FairLock:
    """A lock for the commands of the host and its keep-alive: one thread at a time.

    A command that waits ends the keep-alive's wait for an answer.
    """

    def __init__(self) -> None:
        self.lock = threading.RLock()
        """Held by the thread that uses the line."""
        self._command_waits = threading.Event()
        self._silent: SilentController | None = None

    @property
    def command_waits(self) -> bool:
        """Whether a command waits for the lock."""
        return self._command_waits.is_set()

    @contextmanager
    def keep_alive(self) -> Iterator[None]:
        """Hold the lock; a silent controller found in the block is reported to the next command."""
        with self.lock:
            try:
                yield
            except SilentController as error:
                self._silent = error
                raise

    @contextmanager
    def command(self) -> Iterator[None]:
        """Hold the lock, taken from a waiting keep-alive.

        Raises:
            SilentController: The keep-alive found it so, and no command was sent since.
        """
        with self.command_despite_silence() as error:
            if error is not None:
                raise error
            yield

    @contextmanager
    def command_despite_silence(self) -> Iterator[SilentController | None]:
        """Hold the lock as `command` does; yield the keep-alive's error instead of raising it."""
        self._command_waits.set()
        with self.lock:
            self._command_waits.clear()
            error, self._silent = self._silent, None
            yield error


class Line(Wire):
    """Ask one thing at a time and read exactly its answer; threads share the line.

    Arguments as for `Wire`.
    """

    def __init__(self, port: Port, name: str, timeout: float):
        super().__init__(port, name, timeout)
        self.echo = False
        """Whether the controller repeats what it receives, and the host compares it."""
        self._lock = FairLock()

    def ask(self, *commands: str, keep_waiting: Callable[[], bool] | None = None) -> str:
        """Send commands on one line and return the text that they answer.

        Args:
            commands: What to send.
            keep_waiting: Of the keep-alive: returns after each timeout whether to wait longer
                for the answer. The wait ends early where a command waits for the line.

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
                raise GarbledAnswer(
                    f"controller on {self.name} sent {early!r} before it was asked"
                    f" {';'.join(commands)!r}: its program failed, or another program shares the"
                    " line; look the message up, then connect() again"
                )
            self._send(";".join(commands))
            return self._answer(commands, keep_waiting)

    def numbers(self, command: str, count: int) -> list[float]:
        """Return the numbers that a query answers; refuse another number of them than ``count``."""
        text = self.ask(command)
        try:
            values = [float(word) for word in text.replace(",", " ").split()]
        except ValueError:
            values = []
        if len(values) != count:
            raise GarbledAnswer(
                f"controller on {self.name} answered {command!r} with {_short(text)}, where"
                f" {count} numbers were expected; check the baud rate and the firmware's revision"
            )
        return values

    def read(self, *operands: str) -> list[float]:
        """Return the values of operands such as `_TPA`."""
        return self.numbers(f"MG {','.join(operands)}", len(operands))

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
        """Send commands, a line each; their answers and a lost line are ignored."""
        with self._lock.lock, suppress(LineLost):
            for command in commands:
                self._send(command)

    def send_unchecked(self, commands: Iterable[str], *operands: str) -> list[float]:
        """Send commands, a line each, ignore their answers, and return operands read after them.

        For a line that cannot be trusted, where there is no time to wait for each answer.
        """
        with self._lock.command_despite_silence():
            self.resynchronise()
            for command in commands:
                self._send(command)
            return self._after_mark(operands)[0]

    def _after_mark(self, operands: tuple[str, ...]) -> tuple[list[float], str]:
        """Ask for a number of our own and operands; return the operands, and all that came in."""
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
            held = [line.partition(" ")[2] for line in self.ask("LS").split("\r\n")]
        if held != program:
            raise SettingNotTaken(
                f"controller on {self.name} holds another program than was sent:"
                f" {_short(str(held))}; connect() again, and check the cable's shield"
            )

    def resynchronise(self) -> None:
        """Discard what has come in so far."""
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
        """Return what follows the echo of what was sent."""
        if not self.echo:
            return received
        echo, answer = received[: len(sent)], received[len(sent) :]
        if echo != sent or not answer.startswith("\r"):
            self.resynchronise()
            raise GarbledAnswer(
                f"controller on {self.name} was sent {_short(sent)} and echoed"
                f" {_short(received.partition(chr(13))[0])}; check the cable's shield and"
                " controller.baud_rate"
            )
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
        if any(byte > 126 or (byte < 32 and byte not in b"\t\n\r") for byte in data):
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
        if not code.isdigit():
            raise GarbledAnswer(
                f"controller on {self.name} refused {command!r} and gave {_short(answer)}, not the"
                " code and text of TC1; check the firmware's revision"
            )
        raise CommandRefused(self.name, command, int(code), text.strip())


def pack(commands: Iterable[str]) -> Iterator[tuple[str, ...]]:
    """Group commands so that each group, joined by `;`, fits on one line."""
    line: list[str] = []
    for command in commands:
        if line and len(";".join([*line, command])) > LONGEST_LINE:
            yield tuple(line)
            line = []
        line.append(command)
    if line:
        yield tuple(line)


def _short(text: str) -> str:
    return repr(text if len(text) <= 60 else f"{text[:57]}...")
