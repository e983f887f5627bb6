"""The state of the emulated ODrive, its properties by name, and its simulated time."""

from sautereau.sim_backend.devices.emulators import Plant, along
from sautereau.sim_backend.devices.odrive.axis import MOTOR_FAILED, SYSTEM_LEVEL, OdriveAxis, State
from sautereau.sim_backend.devices.odrive.properties import AXIS, ROOT, Property
from sautereau.trajectory.motion import Floats

LONGEST_WAIT = 60.0  # s, by which the host may advance simulated time at once
_SUPPLY = 24.0  # V


class Machine:
    """A controller at power-up: motors off. Simulated time may wait for the host (decision 0002).

    It is not thread-safe; see `GalilFirmware`.

    Args:
        per_turn: Encoder counts per turn of each motor.
        period: s, of one sample of the bench.
        stepped: Whether time waits for the host while it streams positions.
        torque_per_volt: N m/V of each motor, for the plant's commands [V].
    """

    phase = 0.0
    """There is no output that could change within a sample."""

    def __init__(
        self,
        plant: Plant,
        *,
        per_turn: tuple[float, float],
        period: float,
        stepped: bool,
        torque_per_volt: tuple[float, float],
    ):
        self.plant, self.period, self.stepped = plant, period, stepped
        self._granted = 0
        encoders, switches = plant.encoder_counts(), plant.home_counts()
        self.axes = [
            OdriveAxis(number, *values)
            for number, values in enumerate(zip(per_turn, encoders, switches, strict=True))
        ]
        self.error = 0
        """Error bits of the device."""
        self._torque_per_volt = torque_per_volt

    @property
    def streaming(self) -> bool:
        """Whether the motion is the host's, position by position."""
        return any(axis.following for axis in self.axes)

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
        return self.stepped and self.streaming and not self._granted

    @property
    def moving(self) -> bool:
        """Whether time must advance, because a setpoint changes or the host waits."""
        if self.held:
            return False
        return self._granted > 0 or any(axis.moving for axis in self.axes)

    def outgoing(self) -> dict[str, bytes]:
        """Return what the controller has sent by itself: nothing."""
        return {}

    def grant(self, seconds: float | None) -> bool:
        """Let time advance by some seconds; return False where that is refused."""
        if seconds is None or not self.stepped or not 0 <= seconds <= LONGEST_WAIT:
            return False
        self._granted += max(1, round(seconds / self.period))
        return True

    def tick(self) -> None:
        """Do one sample of the bench."""
        watching = not self.stepped or (self.streaming and self._granted > 0)
        self._granted = max(0, self._granted - 1)
        counts, homes = self.plant.encoder_counts(), self.plant.home_counts()
        for axis, raw, home in zip(self.axes, counts, homes, strict=True):
            axis.sample(raw, home, self.period, watching=watching)

    def reference(self, fractions: Floats) -> tuple[Floats, Floats]:
        """Return the reference within the sample last ticked; see `Emulator`."""
        return along((axis.cubic for axis in self.axes), fractions)

    def trip(self, error: int) -> None:
        """Switch both motors off for an error of the device, such as too low a supply."""
        self.error |= error
        for axis in self.axes:
            axis.settings["motor.error"] = float(int(axis.settings["motor.error"]) | SYSTEM_LEVEL)
            axis.error |= MOTOR_FAILED
            axis.state = State.IDLE

    def clear_errors(self) -> None:
        """Clear all errors: `sc`."""
        self.error = 0
        for axis in self.axes:
            axis.settings |= dict.fromkeys(
                (name for name in AXIS if name.split(".")[-1] == "error"), 0.0
            )

    def value_of(self, name: str) -> str | None:
        """Return the value of a property such as `axis0.error` as text; None for none."""
        index, axis, declared, rest = self._named(name)
        if declared is None:
            return None
        if axis is None:
            return declared.show(self.error if name == "error" else _SUPPLY)
        current = "motor.current_control.Iq_setpoint"
        computed = {
            "controller.trajectory_done": axis.done,
            "current_state": axis.state,
            "min_endstop.endstop_state": axis.pressed,
            "requested_state": 0,  # it is consumed at once
        }
        if rest == current:
            torque = self.plant.torque_volts()[index] * self._torque_per_volt[index]
            return declared.show(torque / axis.settings["motor.config.torque_constant"])
        return declared.show(computed.get(rest, axis.settings[rest]))

    def write(self, name: str, word: str | None) -> list[str]:
        """Set a property to the value of a word; return the firmware's error messages."""
        _, axis, declared, rest = self._named(name)
        if declared is None:
            return ["invalid property"]
        value = None if word is None or not declared.writable else declared.scan(word)
        if value is None:
            return ["not implemented"]
        if axis is None:
            self.error = int(value)
        elif rest == "requested_state":
            axis.request(int(value))
        else:
            axis.settings[rest] = value
            if rest in ("min_endstop.config.enabled", "min_endstop.config.debounce_ms"):
                axis.enable_endstop()
            elif rest == "controller.config.control_mode":
                axis.take_position()
        return []

    def _named(self, name: str) -> tuple[int, OdriveAxis | None, Property | None, str]:
        """Return number, axis and declaration of a property, and its name within the axis."""
        head, _, rest = name.partition(".")
        for index, axis in enumerate(self.axes):
            if head == f"axis{index}":
                return index, axis, AXIS.get(rest), rest
        return 0, None, ROOT.get(name), name
