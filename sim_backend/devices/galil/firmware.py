"""The firmware of a Galil DMC-4020 with two axes, as its serial line shows it.

Lines end with a carriage return. The answer to each accepted command ends with ``:``; a refused
one is answered with ``?``, and the rest of its line is ignored. The layers below are the grammar
(`grammar`), the commands (`commands`), the state (`machine`) and the profilers (`motion`). The
only clock of the firmware is `GalilFirmware.tick`.
"""

from sautereau.rig.schema import Rig
from sautereau.sim_backend.devices.emulators import OnOutput, Plant, along
from sautereau.sim_backend.devices.galil.commands.table import execute, execute_in_program
from sautereau.sim_backend.devices.galil.faults import CommandError
from sautereau.sim_backend.devices.galil.machine import Machine
from sautereau.sim_backend.devices.galil.program import LINE_LENGTH, Program, split_commands
from sautereau.trajectory.motion import Floats

_RETURN, _FEED, _BACKSLASH = b"\r\n\\"


def emulate(rig: Rig, plant: Plant, on_output: OnOutput, paced: bool) -> "GalilFirmware":
    """Return the controller at power-up; see `EMULATORS`."""
    return GalilFirmware(plant, on_output=on_output, host_waits=not paced)


class GalilFirmware(Machine):
    """A controller at power-up: motors off, outputs low, echo on.

    It is not thread-safe: guard `receive` and `tick` by one lock.

    Args:
        plant: Motors and encoders.
        revision: Answer to ^R^V.
        on_output: Called with number (from 1) and level when a digital output changes.
        host_waits: Whether the host sends only while simulated time is stopped: then a looping
            program that the host started runs one iteration, and waits for the next command.
    """

    def __init__(
        self,
        plant: Plant,
        *,
        revision: str = "DMC4020 Rev 1.3a-SIM sautereau stand-in",
        on_output: OnOutput,
        host_waits: bool = False,
    ) -> None:
        super().__init__(plant, revision, on_output, execute_in_program, host_waits)
        self._line = bytearray()
        self._after_download = False

    @property
    def motors_on(self) -> tuple[bool, bool]:
        """Whether each axis is powered."""
        first, second = self.axes
        return first.motor_on, second.motor_on

    @property
    def moving(self) -> bool:
        """Whether a profile, a program or a capture runs, so that time must advance.

        A looping program that the host started, such as a watchdog, does not count.
        """
        if self.in_motion or self.capture.running:
            return True
        return any(not thread.resident for thread in self.threads.values())

    @property
    def watching(self) -> bool:
        """Whether any program runs."""
        return bool(self.threads)

    @property
    def held(self) -> bool:
        """Whether simulated time must not advance: never, all motions are in the controller."""
        return False

    def reference(self, fractions: Floats) -> tuple[Floats, Floats]:
        """Return the reference within the sample last ticked; see `Emulator`."""
        return along((axis.cubic for axis in self.axes), fractions)

    def receive(self, data: bytes) -> bytes:
        """Take bytes from the host; return what the controller sends back.

        Messages of programs since the last call come first.
        """
        answer = bytearray(self.unsolicited.encode("latin-1", "replace"))
        self.unsolicited = ""
        for byte in data:
            if self.download is not None:
                answer += self._download(byte)
                continue
            if self._after_download:
                self._after_download = byte == _FEED
                if byte in (_RETURN, _FEED):
                    continue
            if byte == _FEED:
                continue
            if self.echo:
                answer.append(byte)
            if byte == _RETURN:
                answer += self._answer_line()
            elif len(self._line) <= LINE_LENGTH:
                self._line.append(byte)
        return bytes(answer)

    def _answer_line(self) -> bytes:
        line = self._line.decode("latin-1")
        self._line.clear()
        if len(line) > LINE_LENGTH:
            self.error_code = 5
            return b"?"
        answer = ""
        for command in split_commands(line):
            try:
                reply = execute(self, command)
            except CommandError as error:
                self.error_code = error.code
                return (answer + "?").encode("latin-1")
            if self.download is not None:
                return answer.encode("latin-1")
            answer += ":" if reply is None else f"{reply}\r\n:"
        return (answer or ":").encode("latin-1")

    def _download(self, byte: int) -> bytes:
        """Take a byte of a program, which a backslash ends, together with a return after it.

        Nothing is echoed or answered before the end.
        """
        if self.download is not None and byte != _BACKSLASH:
            if byte != _FEED:
                self.download += chr(byte)
            return b""
        text, self.download = self.download or "", None
        self._after_download = True
        try:
            self.program = Program.parse(text)
        except CommandError as error:
            self.program = Program()
            self.error_code = error.code
            return b"?"
        return b":"
