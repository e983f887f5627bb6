"""The state of the emulated ODrive, and its update in every sample."""

from dataclasses import KW_ONLY, dataclass

from sautereau.sim_backend.devices.cubic import along
from sautereau.sim_backend.devices.emulators import OnOutput, Plant
from sautereau.sim_backend.devices.odrive.axis import OdriveAxis
from sautereau.trajectory.motion import Floats

OUTPUTS = 8
"""Digital outputs, numbered from 1."""


@dataclass(eq=False)
class Machine:
    """A controller at power-up: motors off, outputs low."""

    plant: Plant
    """Motors and encoders."""
    _: KW_ONLY
    per_turn: tuple[float, float]
    """Encoder counts per turn of each motor."""
    period: float
    """s, of one sample of the bench."""
    stepped: bool
    """Whether time waits for the host while the trigger's output is high."""
    trigger: int
    """Number of that output."""
    torque_per_volt: tuple[float, float]
    """N m/V of each motor, for the plant's commands [V]."""
    on_output: OnOutput
    """Called with number (from 1) and level when a digital output changes."""

    def __post_init__(self):
        encoders, switches = self.plant.encoder_counts(), self.plant.home_counts()
        self.axes = [
            OdriveAxis(*values) for values in zip(self.per_turn, encoders, switches, strict=True)
        ]
        self.outputs = [False] * OUTPUTS
        self._granted = 0

    @property
    def motors_on(self) -> tuple[bool, bool]:
        """Whether each axis is powered."""
        first, second = self.axes
        return first.on, second.on

    @property
    def watching(self) -> bool:
        """Whether a watchdog runs while its motor is on."""
        return any(axis.watched for axis in self.axes)

    @property
    def held(self) -> bool:
        """Whether time waits for the host, which streams setpoints."""
        return self.stepped and self.outputs[self.trigger - 1] and not self._granted

    @property
    def moving(self) -> bool:
        """Whether time must advance, because a setpoint changes or the host waits."""
        if self.held:
            return False
        return self._granted > 0 or any(axis.moving for axis in self.axes)

    def tick(self) -> None:
        """Do one sample of the bench."""
        streamed = self._granted > 0 and self.outputs[self.trigger - 1]
        self._granted = max(0, self._granted - 1)
        plant = self.plant
        for axis, raw, home in zip(
            self.axes, plant.encoder_counts(), plant.home_counts(), strict=True
        ):
            axis.look(raw, home, self.period)
            if streamed or not self.stepped:
                axis.watch(self.period)
            else:  # the host is infinitely slow, but alive
                axis.feed()
            axis.step(self.period)

    def reference(self, fractions: Floats) -> tuple[Floats, Floats]:
        """Return the reference within the sample last ticked; see `GalilFirmware`."""
        return along((axis.cubic for axis in self.axes), fractions)

    def grant(self, seconds: float) -> None:
        """Allow time to advance by ``seconds``, at least by a sample."""
        self._granted += max(1, round(seconds / self.period))

    def set_output(self, number: int, level: bool) -> None:
        """Set a digital output, numbered from 1."""
        if self.outputs[number - 1] != level:
            self.outputs[number - 1] = level
            self.on_output(number, level)

    def seen(self, index: int) -> OdriveAxis:
        """Return an axis that has just read its encoder."""
        axis = self.axes[index]
        axis.raw = self.plant.encoder_counts()[index]
        return axis

    def torque(self, index: int) -> float:
        """Return the torque [N m] that an axis commands."""
        return self.plant.torque_volts()[index] * self.torque_per_volt[index]
