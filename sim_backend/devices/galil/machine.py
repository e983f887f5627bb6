"""The controller's state and its update in every sample; its arrays, and the capture into them."""

import re
from collections.abc import Callable

from sautereau.sim_backend.devices.emulators import SERIAL, OnOutput, Plant
from sautereau.sim_backend.devices.galil.answers import CommandError, write_line
from sautereau.sim_backend.devices.galil.axis import AXES, Axis
from sautereau.sim_backend.devices.galil.memory import Memory, Parameters
from sautereau.sim_backend.devices.galil.motion import SAMPLES_PER_SECOND
from sautereau.sim_backend.devices.galil.ports import HANDLES, Ports
from sautereau.sim_backend.devices.galil.program import Limits, Program, Thread
from sautereau.sim_backend.devices.galil.safety import CheckedAxes
from sautereau.sim_backend.devices.galil.tasks import Tasks
from sautereau.sim_backend.parts import ControllerUnit

ARRAYS = 30  # Arrays that may be defined

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9]{0,7}")


class Arrays:
    """Named arrays in a memory of fixed size.

    Args:
        elements: That all arrays together may have.
        burned: Arrays to start with.
    """

    def __init__(self, elements: int, burned: dict[str, list[float]]) -> None:
        self._elements = elements
        self._values = {name: list(values) for name, values in burned.items()}

    @property
    def unused(self) -> int:
        """Arrays that may still be defined."""
        return ARRAYS - len(self._values)

    def items(self) -> list[tuple[str, list[float]]]:
        """Return names and values in alphabetical order."""
        return sorted(self._values.items())

    @property
    def free(self) -> int:
        """Elements that are not in use."""
        return self._elements - sum(map(len, self._values.values()))

    def define(self, sizes: dict[str, int]) -> None:
        """Define arrays of zeros, all of them or none.

        Raises:
            CommandError: A name is invalid or in use, or the memory is full.
        """
        for name, size in sizes.items():
            if not _NAME.fullmatch(name) or name in self._values:
                raise CommandError(57)
            if not 1 <= size <= self._elements:
                raise CommandError(84)
        if len(self._values) + len(sizes) > ARRAYS:
            raise CommandError(67)
        if sum(sizes.values()) > self.free:
            raise CommandError(66)
        self._values.update({name: [0.0] * size for name, size in sizes.items()})

    def remove(self, names: set[str]) -> None:
        """Free the memory of arrays, all of them or none; ``*`` means every array."""
        for name in names - {"*"}:
            self.values(name)
        for name in list(self._values) if "*" in names else names:
            del self._values[name]

    def values(self, name: str) -> list[float]:
        """Return an array itself, into which a capture writes."""
        if name not in self._values:
            raise CommandError(82)
        return self._values[name]

    def element(self, name: str, index: float) -> float:
        """Return one element; index -1 is the array's length."""
        values = self.values(name)
        if index == -1:
            return float(len(values))
        if not 0 <= index < len(values):
            raise CommandError(56)
        return values[int(index)]

    def set_element(self, name: str, index: float, value: float) -> None:
        """Set one element."""
        self.element(name, index)
        if index < 0:
            raise CommandError(56)
        self.values(name)[int(index)] = value


class Capture:
    """RA, RD and RC: every 2^n samples, one number of each source into its array."""

    def __init__(self) -> None:
        self.arrays: list[list[float]] = []
        self.sources: list[Callable[[], float]] = []
        self.index = 0
        """Element that is written next."""
        self.running = False
        self._period = self._countdown = self._length = 0
        self._circular = False

    def start(self, exponent: int, count: int = 0) -> None:
        """Start with the next sample.

        Args:
            exponent: 1 to 8; one record every 2^exponent samples.
            count: Records to take; 0 fills the arrays, a negative number wraps around.

        Raises:
            CommandError: A capture runs, has no arrays or sources, or the arrays are too short.
        """
        if self.running:
            raise CommandError(80)
        if not self.arrays or len(self.arrays) != len(self.sources):
            raise CommandError(81)
        room = min(map(len, self.arrays))
        if abs(count) > room:
            raise CommandError(84)
        self._length, self._circular = abs(count) or room, count < 0
        self._period, self._countdown = 2**exponent, 0
        self.index, self.running = 0, True

    @property
    def awaited(self) -> bool:
        """Whether it runs and ends by itself."""
        return self.running and not self._circular

    def stop(self) -> None:
        """Stop; what has been recorded stays."""
        self.running = False

    def sample(self) -> None:
        """Record, if it is due: the first sample after the start is the first record."""
        if self._countdown > 0:
            self._countdown -= 1
            return
        self._countdown = self._period - 1
        for values, source in zip(self.arrays, self.sources, strict=True):
            values[self.index] = source()
        self.index += 1
        if self.index == self._length:
            self.index = 0 if self._circular else self.index
            self.running = self._circular


Execute = Callable[["Machine", str, Thread | None], str | None]


class Machine(CheckedAxes):
    """The state of the firmware from one sample to the next.

    Args:
        plant: The motors, encoders and switches.
        unit: The controller as bought and configured.
        on_output: Called with number and level when a digital output changes.
        execute: Carries out one command of the host or of a thread, and returns its answer.
        host_waits: Whether the host sends only while simulated time is stopped: then resident
            threads, which wait for it, do not run.
    """

    def __init__(
        self,
        plant: Plant,
        unit: ControllerUnit,
        on_output: OnOutput,
        execute: Execute,
        host_waits: bool,
    ) -> None:
        super().__init__(plant, unit, on_output)
        self.execute = execute
        self.letters = AXES[: unit.galil.axes]
        """Letters of the axes that model and plant have."""
        lines, elements = (4000, 24_000) if unit.large_memory else (2000, 16_000)
        self.limits = Limits(lines, elements=elements, line_length=unit.line_length)
        self.samples = self.started = 0
        """Samples since the start of the emulation, and those of the last power-up."""
        self.memory = Memory()
        self.ports = Ports()
        self.port = SERIAL
        """Letter of the port from which the present command comes."""
        self.host_waits = host_waits
        self.occupied_until = 0.0
        """s since power-on of the emulation, until which a command keeps the interpreter busy."""
        self.power_up()
        for command in unit.burned:
            execute(self, command, None)
        self.burn()
        text = unit.burned_program.strip("\n").replace("\n", "\r")
        self.memory.program = Program.parse(text, self.limits)
        self.power_up()

    def power_up(self, *, factory: bool = False) -> None:
        """Reset: what is burned remains, or with ``factory`` the factory's values."""
        memory = self.memory
        burned = Parameters() if factory else memory.parameters
        counts = self.plant.encoder_counts()
        self.axes = [Axis(each) for each in counts]
        for index, (axis, settings, on, raw) in enumerate(
            zip(self.axes, burned.axes, burned.motors_on, counts, strict=True)
        ):
            axis.settings = dict(settings)
            if on and index < len(self.letters):
                axis.switch_on(raw)
        self.config = {code: list(values) for code, values in burned.config.items()}
        self.error_code = 0
        """Error code of the last refused command, which TC reports."""
        self.latching_amplifier = False
        self.program = memory.program
        self.tasks = Tasks(self._run_command, self._store, self.tell, self.unit.error_routine)
        self._aborted = False
        self.variables: dict[str, float] = dict(memory.variables)
        self.variable_axes: dict[str, int] = {}
        self.password, self.locked = burned.lock
        self.arrays = Arrays(self.limits.elements, memory.arrays)
        self.capture = Capture()
        self.ports.reset()
        self.started = self.samples
        self.outputs.reset(burned.outputs, self.axes)
        self.drive()
        if "#AUTO" in self.program.labels:
            line = self.program.labels["#AUTO"]
            self.tasks.threads[0] = Thread(self.program, line, hosted=True)

    def burn(self) -> None:
        """BN: store the parameters."""
        self.memory.parameters = Parameters(
            tuple(dict(axis.settings) for axis in self.axes),
            tuple(axis.motor_on for axis in self.axes),
            self.config,
            (self.password, self.locked),
            tuple(self.outputs.bits),
        ).only_burnable()

    @property
    def now(self) -> float:
        """Simulated time since the start of the emulation [s]."""
        return self.samples * self.period

    @property
    def period(self) -> float:
        """Sample time [s]: TM microseconds of 1/1.024 us."""
        return self.config["TM"][0] * 1e-3 / 1024

    @property
    def line_busy(self) -> bool:
        """Whether characters are under way, so that real time passes."""
        return False

    def occupy(self, duration: float) -> None:
        """Keep the interpreter of a line that takes time busy for a duration [s]."""
        self.occupied_until = self.now + duration

    @property
    def in_motion(self) -> bool:
        """Whether an axis moves."""
        return any(axis.profile is not None for axis in self.axes)

    def amplifier_bits(self, byte: int) -> int:
        """Return what TA reports: overcurrent in byte 0, nothing else."""
        broken = any(self.plant.amplifier_fault(axis) for axis in range(len(AXES)))
        return int(broken) if byte == 0 else 0

    @property
    def status_byte(self) -> int:
        """What TB reports."""
        tasks = self.tasks
        return bool(tasks.threads) << 7 | tasks.in_error_routine << 4 | int(self.config["EO"][0])

    @property
    def input_bits(self) -> int:
        """What TI reports."""
        return sum(level << bit for bit, level in enumerate(self.inputs))

    def set_variable(self, name: str, value: float) -> None:
        """Set a variable; the first assignment creates it.

        Raises:
            CommandError: There are too many.
        """
        if name not in self.variables and len(self.variables) == self.limits.variables:
            raise CommandError(67)
        self.variables[name] = value

    def drive(self) -> None:
        """Pass OF and TL to the amplifiers."""
        offsets, limits = ([axis.settings[name] for axis in self.axes] for name in ("OF", "TL"))
        self.plant.drive((offsets[0], offsets[1]), (limits[0], limits[1]))

    def tell(self, text: str, port: str | None = None) -> None:
        """Send a message that no host asked for; if its handle is lost, #TCPERR is due."""
        mark = self.config["CW"][0] == 1
        port = port or self.ports.unsolicited_port
        if not self.ports.send(text, port, mark=mark):
            self.lose_handle(port)

    def lose_handle(self, letter: str) -> None:
        """Notice that a handle's host is gone: #TCPERR is due."""
        self.ports.lost_handle = HANDLES.index(letter)
        self.error_code = 123
        self.tasks.raise_once("#TCPERR")

    def tick(self) -> None:
        """Do one sample: safety, capture, the profilers, and then the programs' lines.

        The first two see the start of the sample; what a line starts moves in the next sample.
        """
        counts = self.plant.encoder_counts()
        for index, axis in enumerate(self.axes):
            if not axis.motor_on:
                axis.follow(counts[index])
                axis.brake_samples = max(0, axis.brake_samples - 1)
            raw = counts[index]
            latched = self.plant.index(index)
            if axis.latch_armed and latched is not None:
                axis.latched, axis.latch_armed = latched, False
            speed = (raw - axis.last_raw) * SAMPLES_PER_SECOND
            axis.filtered_speed += (speed - axis.filtered_speed) / 256
            axis.last_raw = raw
        active = self.check(counts)
        if self.capture.running:
            self.capture.sample()
        for axis in self.axes:
            axis.step()
        self.tasks.raise_events(active, self.program)
        if self.tasks.threads:
            # A resident thread does not run while the host waits for rest.
            wait = self.host_waits and not self.line_busy
            held = {n for n, thread in self.tasks.threads.items() if wait and thread.resident}
            self.tasks.run(self.period, self.program, held)
        self.tasks.phase = 0.0
        self.samples += 1

    def _store(self, code: int) -> None:
        self.error_code = code

    def _run_command(self, command: str, thread: Thread) -> None:
        """Carry out a command of a program; its answer is sent as a message."""
        answer = self.execute(self, command, thread)
        if answer is not None:
            self.tell(write_line(answer))
