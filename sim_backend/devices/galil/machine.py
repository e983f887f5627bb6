"""The controller's state, and its update in every sample."""

from collections.abc import Callable

from sautereau.sim_backend.devices.emulators import OnOutput, Plant
from sautereau.sim_backend.devices.galil.arrays import Arrays, Capture
from sautereau.sim_backend.devices.galil.axis import Axis
from sautereau.sim_backend.devices.galil.faults import CommandError
from sautereau.sim_backend.devices.galil.motion import StopCode
from sautereau.sim_backend.devices.galil.program import LINE_TIME, THREADS, Program, Thread

OUTPUTS = 8
"""Digital outputs, numbered from 1."""
INPUTS = 8
"""Digital inputs, numbered from 1."""
VARIABLES = 510
"""Largest number of variables."""


class Machine:
    """The state of the firmware from one sample to the next.

    Args:
        plant: The motors and encoders.
        revision: Answer to ^R^V.
        on_output: Called with number and level when a digital output changes.
        execute: Carries out one command of a program's thread.
        host_waits: Whether the host sends only while simulated time is stopped: then resident
            threads, which wait for it, do not run.
    """

    def __init__(
        self,
        plant: Plant,
        revision: str,
        on_output: OnOutput,
        execute: Callable[["Machine", str, Thread], None],
        host_waits: bool,
    ) -> None:
        self.plant = plant
        self.revision = revision
        self.burned = Program()
        """The program that survives power-off."""
        self.inputs = [True] * INPUTS
        """Levels of the digital inputs, which are pulled up."""
        self.outputs = [False] * OUTPUTS
        self.samples = 0
        """Samples since the start of the emulation."""
        self._on_output = on_output
        self._execute = execute
        self.host_waits = host_waits
        self.power_up()

    def power_up(self) -> None:
        """Reset: motors and outputs off; only the burned program remains."""
        self.axes = [Axis(counts) for counts in self.plant.encoder_counts()]
        self.sample_time = 1000
        """TM, in units of 1/1024 ms."""
        self.error_code = 0
        """Of the last refused command, for TC."""
        self.echo = True
        self.download: str | None = None
        """Text of the program being downloaded; None outside DL."""
        self.program = self.burned
        self.threads: dict[int, Thread] = {}
        self.variables: dict[str, float] = {}
        self.arrays = Arrays()
        self.capture = Capture()
        self.unsolicited = ""
        """Messages of programs that the host has not read yet."""
        self._lines, self._served = 0.0, -1
        for number in range(1, OUTPUTS + 1):
            self.set_output(number, False)
        self.drive()
        if "#AUTO" in self.program.labels:
            self.threads[0] = Thread(self.program, self.program.labels["#AUTO"], hosted=True)

    @property
    def in_motion(self) -> bool:
        """Whether an axis moves."""
        first, second = self.axes
        return first.profile is not None or second.profile is not None

    def position(self, axis: int) -> int:
        """Return the counts that TP reports."""
        return self.plant.encoder_counts()[axis] + self.axes[axis].offset

    def commanded(self, axis: int) -> int:
        """Return the counts that RP reports; with the motor off those of the position."""
        if not self.axes[axis].motor_on:
            return self.position(axis)
        return self.axes[axis].reported

    def error(self, axis: int) -> int:
        """Return the following error that TE reports [counts]."""
        return self.commanded(axis) - self.position(axis)

    def set_variable(self, name: str, value: float) -> None:
        """Set a variable; the first assignment creates it.

        Raises:
            CommandError: There are too many.
        """
        if name not in self.variables and len(self.variables) == VARIABLES:
            raise CommandError(67)
        self.variables[name] = value

    def drive(self) -> None:
        """Pass OF and TL to the amplifiers."""
        offsets, limits = ([axis.settings[name] for axis in self.axes] for name in ("OF", "TL"))
        self.plant.drive((offsets[0], offsets[1]), (limits[0], limits[1]))

    def set_output(self, number: int, level: bool) -> None:
        """Set a digital output, and report a change."""
        if self.outputs[number - 1] != level:
            self.outputs[number - 1] = level
            self._on_output(number, level)

    def motor_off(self, axis: Axis, code: StopCode) -> None:
        """Switch an axis off, and store the reason."""
        axis.halt(code)
        axis.stop_code = code
        axis.motor_on = False

    def abort(self, *, programs: bool) -> None:
        """Stop both axes at once; where OE is 1 the motor is switched off as well."""
        for axis in self.axes:
            axis.halt(StopCode.ABORTED)
            if axis.settings["OE"]:
                axis.motor_on = False
        if programs:
            self.halt_threads(range(THREADS))

    def halt_threads(self, numbers: range | list[int]) -> None:
        """End threads, if they run."""
        for number in numbers:
            if number in self.threads:
                self.threads.pop(number).running = False

    def tick(self) -> None:
        """Do one sample: programs, safety, capture, and then the profilers.

        The first three see the start of the sample.
        """
        counts = self.plant.encoder_counts()
        for axis, raw in zip(self.axes, counts, strict=True):
            if not axis.motor_on:
                axis.follow(raw)
        if self.threads:
            self._run_threads()
        for axis, raw in zip(self.axes, counts, strict=True):
            if axis.motor_on and axis.exceeds_error_limit(raw):
                if 0 in self.threads:
                    self.threads[0].interrupt("#POSERR")
                if axis.settings["OE"]:
                    self.motor_off(axis, StopCode.OFF_ON_ERROR)
                    axis.follow(raw)
        if self.capture.running:
            self.capture.sample()
        for axis in self.axes:
            axis.step()
        self.samples += 1

    def _run_threads(self) -> None:
        """Run the threads alternately, line by line, as many lines as fit into a sample."""
        self._lines = self._lines % 1 + self.sample_time * 1e-3 / 1024 / LINE_TIME
        # A resident thread does not run while the host waits for rest.
        held = {n for n, thread in self.threads.items() if self.host_waits and thread.resident}
        for number, thread in sorted(self.threads.items()):
            if number not in held and thread.wait is not None and not thread.waiting:
                self._run_line(number, thread)  # the rest of a line whose time has been counted
        while self._lines >= 1:
            ready = [n for n, each in self.threads.items() if n not in held and not each.waiting]
            if not ready:
                return
            later = [number for number in ready if number > self._served]
            self._served = min(later or ready)
            self._lines -= 1
            self._run_line(self._served, self.threads[self._served])

    def _run_line(self, number: int, thread: Thread) -> None:
        if not thread.running:
            return
        try:
            thread.run_line(lambda command, thread: self._execute(self, command, thread))
        except CommandError as error:
            self.error_code = error.code
            self.unsolicited += f"?{thread.line} {thread.command}\r\n"
            thread.running = False
        if not thread.running and self.threads.get(number) is thread:
            del self.threads[number]
