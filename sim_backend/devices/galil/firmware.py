"""The firmware of a Galil controller with two axes, as its ports show it.

The layers below are the commands (`commands`, checked against `reference`), the grammar
(`grammar`), the state (`machine`, `safety`, `tasks`) and the profilers (`motion`, `homing`). The
only clock of the firmware is `GalilFirmware.tick`.
"""

from collections import deque

from sautereau.rig.schema import Rig
from sautereau.sim_backend.devices.emulators import SERIAL, OnOutput, Plant, along
from sautereau.sim_backend.devices.galil.answers import CommandError
from sautereau.sim_backend.devices.galil.commands.table import execute
from sautereau.sim_backend.devices.galil.machine import Machine
from sautereau.sim_backend.devices.galil.ports import Download, Port, answer_line
from sautereau.sim_backend.parts import ControllerUnit
from sautereau.trajectory.motion import Floats


def emulate(
    rig: Rig, plant: Plant, on_output: OnOutput, paced: bool, unit: ControllerUnit | None = None
) -> "GalilFirmware":
    """Return the controller at power-up; see `EMULATORS`."""
    return GalilFirmware(plant, unit, on_output=on_output, host_waits=not paced)


class GalilFirmware(Machine):
    """A controller at power-up.

    It is not thread-safe: guard `receive` and `tick` by one lock.

    Args:
        unit: The controller as bought and configured; by default a new one with `MO` burned.
        on_output: Called with number (from 1) and level when a digital output changes.
        host_waits: Whether the host sends only while simulated time is stopped: then a looping
            program that the host started runs one iteration, and waits for the next command.
    """

    def __init__(
        self,
        plant: Plant,
        unit: ControllerUnit | None = None,
        *,
        on_output: OnOutput,
        host_waits: bool = False,
    ) -> None:
        unit = unit or ControllerUnit()
        self._giving_up: dict[str, int] = {}
        self._uart = Uart(unit.baud_rate, unit.input_buffer) if unit.baud_rate else None
        super().__init__(plant, unit, on_output, execute, host_waits)
        silent = self.unit.interface == "usb" and not self.unit.usb_echo
        if silent:
            self.config["EO"][0] = 0

    @property
    def motors_on(self) -> tuple[bool, bool]:
        first, second = self.axes
        return first.powered, second.powered

    @property
    def moving(self) -> bool:
        """Whether a profile, a program or a capture runs, so that time must advance.

        What does not end by itself does not count: a looping program that the host started, such
        as a watchdog, and a circular capture.
        """
        if self.in_motion or self.capture.awaited or self.line_busy:
            return True
        if self.tasks.pending and not self.tasks.in_error_routine:
            return True
        return any(not thread.resident for thread in self.tasks.threads.values())

    @property
    def watching(self) -> bool:
        """Whether any program runs."""
        return bool(self.tasks.threads)

    @property
    def held(self) -> bool:
        """Whether simulated time must not advance: never, all motions are in the controller."""
        return False

    @property
    def phase(self) -> float:
        """Fraction of the sample that has passed when an output changes."""
        return self.tasks.phase

    def reference(self, fractions: Floats) -> tuple[Floats, Floats]:
        return along((axis.cubic for axis in self.axes), fractions)

    @property
    def line_busy(self) -> bool:
        """Whether characters are under way on the serial line."""
        return self._uart is not None and self._uart.busy

    def connect(self, peer: int = 1000) -> str | None:
        """Open a connection from a host's TCP port; return its handle, None if all are in use."""
        return self.ports.connect(peer)

    def disconnect(self, letter: str) -> None:
        """Lose a TCP connection."""
        self.ports.disconnect(letter)

    def miss_acknowledgement(self, letter: str) -> None:
        """Give a handle up after some retries, because its host does not acknowledge a message."""
        self._giving_up.setdefault(letter, self.samples + 5 * 250)  # Five retries

    def connected(self, letter: str) -> bool:
        """Return whether a handle is open."""
        return letter in self.ports.open

    def outgoing(self) -> dict[str, bytes]:
        if self._uart is not None:
            self._uart.write(self.ports.collect(SERIAL), self.now)
        sent = {letter: self.ports.collect(letter) for letter in self.ports.waiting}
        if self._uart is not None and (delivered := self._uart.delivered(self.now)):
            sent[SERIAL] = delivered
        return sent

    def tick(self) -> None:
        """Do one sample; a serial line carries the characters that are due."""
        super().tick()
        for letter in [each for each, at in self._giving_up.items() if at <= self.samples]:
            del self._giving_up[letter]
            self.ports.disconnect(letter)
            self.lose_handle(letter)
        uart = self._uart
        if uart is None or not uart.busy:
            return
        if uart.overflowed(self.now):
            self.error_code = 5
        while self.now >= self.occupied_until and (byte := uart.next_byte(self.now)):
            uart.write(self._take(byte, SERIAL), self.now)

    def receive(self, data: bytes, letter: str = SERIAL) -> bytes:
        """Take bytes from the host at a port; return what the controller sends back at once.

        Messages of programs that wait for this port come first. A serial line that takes time
        answers later, by `outgoing`.
        """
        if letter == SERIAL and self._uart is not None:
            self._uart.send(data, self.now)
            return b""
        if letter not in self.ports.open:  # a reset has lost it
            return b""
        return self.ports.collect(letter) + self._take(data, letter)

    def _take(self, data: bytes, letter: str) -> bytes:
        answer = bytearray()
        port = self.ports[letter]
        echoes = letter == SERIAL
        for byte in data:
            if (download := port.download) is not None:
                if port.take_download(download, byte):
                    answer += self._store_download(download)
                continue
            line_feed = byte == 10 or (port.after_download and byte == 13)
            if echoes and self.config["EO"][0] and not line_feed:
                answer.append(byte)
            try:
                line = port.take(byte, self.limits.line_length)
            except CommandError as error:
                self.error_code = error.code
                answer += b"?"
                continue
            if line is not None:
                answer += self._answer(line, port)
                if letter not in self.ports.open:  # RS loses it
                    break
                port = self.ports[letter]
        return bytes(answer)

    def _answer(self, line: str, port: Port) -> bytes:
        self.port = port.letter
        answer, code = answer_line(line, lambda command: execute(self, command), port)
        if code is not None:
            self.error_code = code
        waiting = self.ports.collect(port.letter)  # what the commands themselves have sent
        return waiting + answer.encode("latin-1", "replace")

    def _store_download(self, download: Download) -> bytes:
        try:
            download.store(download.text)
        except CommandError as error:
            self.error_code = error.code
            return b"?"
        return b":"


class Uart:
    """Characters under way in both directions, in simulated time.

    Args:
        baud_rate: Bits per second.
        buffer: Characters that wait while the controller is busy; later ones are lost.
    """

    def __init__(self, baud_rate: int, buffer: int) -> None:
        self._time, self._buffer = 10 / baud_rate, buffer  # With its start and stop bit
        self._in: deque[tuple[float, int]] = deque()
        self._out: deque[tuple[float, int]] = deque()
        self._in_free = self._out_free = 0.0

    @property
    def busy(self) -> bool:
        """Whether characters are under way or wait."""
        return bool(self._in or self._out)

    def send(self, data: bytes, now: float) -> None:
        """Send bytes from the host at a time [s]."""
        for byte in data:
            self._in_free = max(self._in_free, now) + self._time
            self._in.append((self._in_free, byte))

    def write(self, data: bytes, now: float) -> None:
        """Send bytes to the host at a time [s]."""
        for byte in data:
            self._out_free = max(self._out_free, now) + self._time
            self._out.append((self._out_free, byte))

    def overflowed(self, now: float) -> bool:
        """Drop what has arrived by a time [s] and does not fit; return whether there was any."""
        arrived = sum(1 for time, _ in self._in if time <= now)
        if arrived <= self._buffer:
            return False
        kept = [each for i, each in enumerate(self._in) if not self._buffer <= i < arrived]
        self._in = deque(kept)
        return True

    def next_byte(self, now: float) -> bytes:
        """Return the next byte that has arrived by a time [s], if any."""
        if self._in and self._in[0][0] <= now:
            return bytes((self._in.popleft()[1],))
        return b""

    def delivered(self, now: float) -> bytes:
        """Return the bytes that have reached the host by a time [s]."""
        bytes_out = bytearray()
        while self._out and self._out[0][0] <= now:
            bytes_out.append(self._out.popleft()[1])
        return bytes(bytes_out)
