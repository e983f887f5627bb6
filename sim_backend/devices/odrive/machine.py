"""The state of the emulated ODrive: its update in every sample, and its properties by name."""

import re
from dataclasses import KW_ONLY, dataclass

from sautereau.sim_backend.devices.emulators import OnOutput, Plant, along
from sautereau.sim_backend.devices.odrive.axis import TORQUE_CONSTANT, OdriveAxis
from sautereau.trajectory.motion import Floats

OUTPUTS = 8
"""Digital outputs, numbered from 1."""
LARGEST = 1e10
"""Largest magnitude of a number that is accepted."""
_SUPPLY = 24.0  # V
_INTEGERS = frozenset(
    {
        "config.enable_watchdog",
        "controller.config.circular_setpoints",
        "controller.config.control_mode",
        "controller.config.input_mode",
        "encoder.config.cpr",
        "min_endstop.config.enabled",
    }
)


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
    def phase(self) -> float:
        """Fraction of the sample that has passed when an output changes: none, at its start."""
        return 0.0

    def outgoing(self) -> dict[str, bytes]:
        """Return what the controller has sent by itself: nothing."""
        return {}

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
        """Return the reference within the sample last ticked; see `Emulator`."""
        return along((axis.cubic for axis in self.axes), fractions)

    def value_of(self, name: str) -> str | None:
        """Return the value of a property such as `axis0.error` as text, or None if there is none.

        `gpio1.state` to `gpio8.state` are the stand-in's own (docs/decisions/0006).
        """
        if (output := _output(name)) is not None:
            return str(int(self.outputs[output - 1]))
        if name == "vbus_voltage":
            return f"{_SUPPLY:.6f}"
        index, axis, rest = self._named(name)
        if axis is None:
            return None
        if rest == "motor.current_control.Iq_setpoint":
            torque = self.plant.torque_volts()[index] * self.torque_per_volt[index]
            return f"{torque / TORQUE_CONSTANT:.6f}"
        integers = {
            "current_state": axis.state,
            "error": axis.error,
            "motor.error": 0,
            "encoder.error": 0,
            "controller.error": 0,
            "controller.trajectory_done": axis.done,
            "is_homed": axis.homed,
            "min_endstop.endstop_state": axis.pressed,
        }
        if rest in integers:
            return str(int(integers[rest]))
        if rest not in axis.settings:
            return None
        value = axis.settings[rest]
        return str(int(value)) if rest in _INTEGERS else f"{value:.6f}"

    def write(self, name: str, word: str | None) -> list[str]:
        """Set a property to the value of a word; return the firmware's error messages."""
        value = None if word is None else number(word)
        output = _output(name)
        _, axis, rest = self._named(name)
        known = output is not None or (
            axis is not None and (rest == "requested_state" or rest in axis.settings)
        )
        if not known:
            return ["invalid property"]
        if value is None:
            return ["not implemented"]
        if output is not None:
            if self.outputs[output - 1] != (value != 0):
                self.outputs[output - 1] = value != 0
                self.on_output(output, value != 0)
        elif axis is not None and rest == "requested_state":
            axis.request(int(value))
        elif axis is not None:
            axis.settings[rest] = float(int(value)) if rest in _INTEGERS else value
            if rest == "config.watchdog_timeout":
                axis.feed()
            axis.look_at_endstop()
        return []

    def _named(self, name: str) -> tuple[int, OdriveAxis | None, str]:
        """Return number and axis from the head of a property's name, and the rest of the name."""
        head, _, rest = name.partition(".")
        for index, axis in enumerate(self.axes):
            if head == f"axis{index}":
                return index, axis, rest
        return 0, None, ""


def _output(name: str) -> int | None:
    """Return the number of the output whose level a property is."""
    found = re.fullmatch(rf"gpio([1-{OUTPUTS}])\.state", name)
    return int(found[1]) if found else None


def number(word: str) -> float | None:
    """Return a number, or None for a text that is none, or too large a number."""
    try:
        value = float(word)
    except ValueError:
        return None
    return value if abs(value) <= LARGEST else None
