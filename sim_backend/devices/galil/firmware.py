"""The firmware of a Galil DMC-4020 with two axes, as its serial line shows it.

Lines end with a carriage return. Each accepted command answers ``:`` after what it
tells, each refused one ``?``, and a line stops there. Behind it are the grammar
(`grammar`), the commands (`commands`), the state (`machine`) and
the profilers (`motion`). The firmware knows no clock but `GalilFirmware.tick`.
"""

from sautereau.rig.schema import Rig
from sautereau.sim_backend.devices.cubic import along
from sautereau.sim_backend.devices.emulators import OnOutput, Plant
from sautereau.sim_backend.devices.galil.commands.table import execute, execute_in_program
from sautereau.sim_backend.devices.galil.faults import CommandError
from sautereau.sim_backend.devices.galil.machine import Machine
from sautereau.sim_backend.devices.galil.program import LINE_LENGTH, Program, split_commands
from sautereau.trajectory.motion import Floats

_RETURN, _FEED, _BACKSLASH = b"\r\n\\"


def emulate(rig: Rig, plant: Plant, on_output: OnOutput, paced: bool) -> "GalilFirmware":
    """Return the controller at power-up; arguments of `new_emulator`."""
    return GalilFirmware(plant, on_output=on_output, host_waits=not paced)


class GalilFirmware:
    """A controller at power-up: motors off, outputs low, echo on.

    It is not safe for threads: whoever calls `receive` from one and `tick` from
    another holds a lock around both.

    Args:
        plant: What amplifiers and encoders are wired to.
        revision: Answer to ^R^V.
        on_output: Called with number (from 1) and level when a digital output changes.
        host_waits: Whether the host only speaks when nothing moves, however long that takes:
            then programs that go round and round waiting for it stand still.
    """

    def __init__(
        self,
        plant: Plant,
        *,
        revision: str = "DMC4020 Rev 1.3a-SIM sautereau stand-in",
        on_output: OnOutput,
        host_waits: bool = False,
    ) -> None:
        self._machine = Machine(plant, revision, on_output, execute_in_program, host_waits)
        self._line = bytearray()
        self._after_download = False

    @property
    def motors_on(self) -> tuple[bool, bool]:
        """Whether each axis is powered."""
        first, second = self._machine.axes
        return first.motor_on, second.motor_on

    @property
    def moving(self) -> bool:
        """Whether a profile, a program or a capture runs: time must go on.

        A program that the host began and that goes round and round, such as a watchdog, is none.
        """
        machine = self._machine
        if machine.in_motion or machine.capture.running:
            return True
        return any(not thread.resident for thread in machine.threads.values())

    @property
    def watching(self) -> bool:
        """Whether a program runs, of whatever kind."""
        return bool(self._machine.threads)

    @property
    def held(self) -> bool:
        """Whether simulated time must not advance: never, all motions are in the controller."""
        return False

    @property
    def sample_period(self) -> float:
        """Seconds of one sample: TM in microseconds, of which a thousand last 1/1024 s."""
        return self._machine.sample_time / 1000 / 1024

    @property
    def samples(self) -> int:
        """Samples ticked since power-up."""
        return self._machine.samples

    def set_input(self, number: int, level: bool) -> None:
        """Set a digital input, numbered from 1; at power-up all are high, being pulled up."""
        self._machine.inputs[number - 1] = level

    def tick(self) -> None:
        """Do one controller sample.

        Programs, the error limit and the capture see the encoders as they are now, at
        its beginning; the motion then goes from here to its end.
        """
        self._machine.tick()

    def reference(self, fractions: Floats) -> tuple[Floats, Floats]:
        """Return the reference within the sample last ticked, before any tick its start.

        With a motor off it is where the encoder was at that tick.

        Args:
            fractions (array): shape (k,), of the sample, 0 to 1; past 1 the cubic goes on.

        Returns:
            Positions [raw encoder counts] and velocities [counts a sample], shapes (k, 2).
        """
        return along((axis.cubic for axis in self._machine.axes), fractions)

    def receive(self, data: bytes) -> bytes:
        """Take bytes from the host; return what the controller sends back.

        What programs have said since the last call comes first.
        """
        machine = self._machine
        answer = bytearray(machine.unsolicited.encode("latin-1", "replace"))
        machine.unsolicited = ""
        for byte in data:
            if machine.download is not None:
                answer += self._download(byte)
                continue
            if self._after_download:
                self._after_download = byte == _FEED
                if byte in (_RETURN, _FEED):
                    continue
            if byte == _FEED:
                continue
            if machine.echo:
                answer.append(byte)
            if byte == _RETURN:
                answer += self._answer_line()
            elif len(self._line) <= LINE_LENGTH:
                self._line.append(byte)
        return bytes(answer)

    def _answer_line(self) -> bytes:
        line = self._line.decode("latin-1")
        self._line.clear()
        machine = self._machine
        if len(line) > LINE_LENGTH:
            machine.error_code = 5
            return b"?"
        answer = ""
        for command in split_commands(line):
            try:
                told = execute(machine, command)
            except CommandError as error:
                machine.error_code = error.code
                return (answer + "?").encode("latin-1")
            if machine.download is not None:
                return answer.encode("latin-1")
            answer += ":" if told is None else f"{told}\r\n:"
        return (answer or ":").encode("latin-1")

    def _download(self, byte: int) -> bytes:
        """Take a byte of a program; a backslash ends it, with the return behind it if there is one.

        Nothing is echoed or answered before that.
        """
        machine = self._machine
        if machine.download is not None and byte != _BACKSLASH:
            if byte != _FEED:
                machine.download += chr(byte)
            return b""
        text, machine.download = machine.download or "", None
        self._after_download = True
        try:
            machine.program = Program.parse(text)
        except CommandError as error:
            machine.program = Program()
            machine.error_code = error.code
            return b"?"
        return b":"
