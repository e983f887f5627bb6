"""The controller's ports: a serial one, and the handles of TCP connections.

Lines end with a carriage return. The answer to each accepted command ends with ``:``; a refused
one is answered with ``?``, and the rest of its line is ignored.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from sautereau.sim_backend.devices.emulators import SERIAL
from sautereau.sim_backend.devices.galil.answers import CommandError, write_line
from sautereau.sim_backend.devices.galil.program import split_commands

HANDLES = "ABCDEFGH"  # Ethernet handles

RETURN, FEED = b"\r\n"
DOWNLOAD_ENDS = b"\\\x1a\x11\x04"  # What ends DL: a backslash, control-Z, control-Q or control-D

Execute = Callable[[str], str | None]  # Carries out one command of the host and returns its answer


@dataclass
class Download:
    """The text that follows DL or QD up to its end, and what takes it then."""

    store: Callable[[str], None]
    text: str = ""


@dataclass
class Port:
    """One line to a host."""

    letter: str
    line: bytearray = field(default_factory=bytearray)
    """Characters of the command line so far."""
    peer: int = 0
    """TCP port of the host, of a handle."""
    download: Download | None = None
    """Being read; None outside DL and QD."""
    after_download: bool = False

    def take(self, byte: int, longest: int) -> str | None:
        """Take a byte; return the line that it ends.

        Raises:
            CommandError: The line is too long.
        """
        if self.after_download:
            self.after_download = byte == FEED
            if byte in (RETURN, FEED):
                return None
        if byte == FEED:
            return None
        if byte != RETURN:
            if len(self.line) <= longest:
                self.line.append(byte)
            return None
        line = self.line.decode("latin-1")
        self.line.clear()
        if len(line) > longest:
            raise CommandError(5)
        return line

    def take_download(self, download: Download, byte: int) -> bool:
        """Take a byte of a download, return whether it ends. Nothing is echoed before that."""
        if byte not in DOWNLOAD_ENDS:
            download.text += "" if byte == FEED else chr(byte)
            return False
        self.download, self.after_download = None, True
        return True


def answer_line(line: str, execute: Execute, port: Port) -> tuple[str, int | None]:
    """Carry out a line of commands.

    Returns:
        The answer, and the error's code if a command was refused.
    """
    answer = ""
    for command in split_commands(line):
        try:
            reply = execute(command)
        except CommandError as error:
            return answer + "?", error.code
        if port.download is not None:
            return answer, None
        answer += ":" if reply is None else f"{write_line(reply)}:"
    return answer or ":", None


class Ports:
    """All ports, and the messages that no host asked for."""

    def __init__(self) -> None:
        self._ports = {SERIAL: Port(SERIAL)}
        self._outbox: dict[str, str] = {}
        self.unsolicited_port = SERIAL
        """Letter of the port to which CF sends unsolicited messages."""
        self.lost_handle = -1
        """Number of the handle that was lost last."""

    def __getitem__(self, letter: str) -> Port:
        return self._ports[letter]

    @property
    def open(self) -> str:
        """Letters of the open ports."""
        return "".join(self._ports)

    def reset(self) -> None:
        """Forget half lines and messages, and lose all connections."""
        self._ports = {SERIAL: Port(SERIAL)}
        self._outbox.clear()
        self.unsolicited_port, self.lost_handle = SERIAL, -1

    def connect(self, peer: int) -> str | None:
        """Open the first free handle to a host's TCP port; None if there is none."""
        letter = next((each for each in HANDLES if each not in self._ports), None)
        if letter is not None:
            self._ports[letter] = Port(letter, peer=peer)
        return letter

    def disconnect(self, letter: str) -> None:
        """Close a handle whose connection is gone."""
        self._ports.pop(letter, None)

    def send(self, text: str, letter: str, *, mark: bool) -> bool:
        """Send a message that no host asked for; with ``mark`` bit 7 of its characters is set.

        Returns:
            False if its handle is lost.
        """
        if letter not in self._ports:
            return False
        if mark:
            text = "".join(chr(ord(character) | 128) for character in text)
        self._outbox[letter] = self._outbox.get(letter, "") + text
        return True

    def collect(self, letter: str) -> bytes:
        """Return the messages that wait for a port's host."""
        return self._outbox.pop(letter, "").encode("latin-1", "replace")

    @property
    def waiting(self) -> tuple[str, ...]:
        """Letters of the ports with messages that wait."""
        return tuple(self._outbox)
