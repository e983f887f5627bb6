"""The emulated ODrive: its ASCII protocol byte by byte, its properties, and its simulated time.

Lines end with a line feed, a carriage return or `!`; a `;` starts a comment. A line with a
checksum (`*` and the exclusive or of the bytes before it) is answered with one, and ignored if
the checksum is wrong. Only queries and refused lines are answered; an empty line is refused too.

After `Firmware/communication/ascii_protocol.cpp` of odriverobotics/ODrive, tag fw-v0.5.6, without
its commands q, v, c, e and h, and without those that save and reboot. Its properties include no
pin of the device, so that nothing sets an output.

One property is the stand-in's own: `stand_in.wait` advances simulated time (docs/decisions/0002).
"""

import functools
import operator
from collections.abc import Callable

from sautereau.rig.schema import Rig
from sautereau.sim_backend.devices.emulators import AMPLIFIER_VOLTS, OnOutput, Plant, along
from sautereau.sim_backend.devices.odrive.axis import MOTOR_FAILED, SYSTEM_LEVEL, OdriveAxis, State
from sautereau.sim_backend.devices.odrive.properties import AXIS, FLOAT, ROOT, Property, single
from sautereau.trajectory.motion import Floats

_LINE = 256  # Largest number of bytes in a line; a longer one is ignored


def emulate(rig: Rig, plant: Plant, _on_output: OnOutput, paced: bool) -> "OdriveFirmware":
    """Return the controller at power-up; see `EMULATORS`."""
    counts = rig.arm.counts_per_revolution
    first, second = rig.arm.gear_ratios
    per_volt = rig.arm.torque_limit / AMPLIFIER_VOLTS
    return OdriveFirmware(
        plant,
        per_turn=(counts / first, counts / second),
        period=rig.controller.sample_period,
        stepped=not paced,
        torque_per_volt=(per_volt / first, per_volt / second),
    )


class OdriveFirmware:
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
        self._line = bytearray()
        self._commands: dict[str, Callable[[str], list[str]]] = {
            "p": _for_axis(self._position, 2),
            "t": _for_axis(self._trajectory, 2),
            "f": _for_axis(self._feedback, 1),
            "i": self._information,
            "r": self._read,
            "w": self._write,
            "u": _for_axis(self._update, 1),
            "s": self._system,
        }

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
    def line_busy(self) -> bool:
        """Its line takes no time."""
        return False

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
        if seconds is None or not self.stepped or not 0 <= seconds <= 60.0:
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

    # The protocol

    def receive(self, data: bytes) -> bytes:
        """Take bytes from the host; return what the controller sends back."""
        answer = bytearray()
        for byte in data:
            if byte in b"\r\n!":
                if len(self._line) <= _LINE:
                    answer += self._answer(self._line.decode("latin-1"))
                self._line.clear()
            elif len(self._line) <= _LINE:
                self._line.append(byte)
        return bytes(answer)

    def _answer(self, line: str) -> bytes:
        text, star, given = line.partition(";")[0].partition("*")
        if star and not (given.strip().isdecimal() and int(given) == _checksum(text)):
            return b""
        command = self._commands.get(text[:1])  # an empty line is a command that is unknown
        answers = command(text) if command else ["unknown command"]
        answer = ""
        for each in answers:
            each = each[:63]
            answer += f"{each}*{_checksum(each)}\r\n" if star else f"{each}\r\n"
        return answer.encode("latin-1")

    def _position(self, index: int, position: float, *rest: float) -> list[str]:
        self.axes[index].follow(position, rest[0] if rest else None)
        return []

    def _trajectory(self, index: int, goal: float, *rest: float) -> list[str]:
        self.axes[index].move(goal)
        return []

    def _feedback(self, index: int, *rest: float) -> list[str]:
        axis = self.axes[index]
        axis.raw = self.plant.encoder_counts()[index]
        return [f"{single(axis.position):.6f} {single(axis.velocity):.6f}"]

    def _update(self, index: int, *rest: float) -> list[str]:
        self.axes[index].feed()
        return []

    def _information(self, text: str) -> list[str]:
        pace = "stepped" if self.stepped else "paced"
        return [
            "Hardware version: 3.6-56V",
            "Firmware version: 0.5.6",
            f"Serial number: SIM sautereau stand-in, {pace}",
        ]

    def _system(self, text: str) -> list[str]:
        if text[1:2] == "c":
            self.clear_errors()
        return []

    def _read(self, text: str) -> list[str]:
        words = text.split()
        if len(words) < 2:
            return ["invalid command format"]
        value = self.value_of(words[1])
        return ["invalid property" if value is None else value]

    def _write(self, text: str) -> list[str]:
        words = text.split()
        if len(words) < 2:
            return ["invalid command format"]
        name, word = words[1], words[2] if len(words) > 2 else None
        if name == "stand_in.wait":
            seconds = None if word is None else FLOAT.scan(word)
            # The answer makes the host wait until time has advanced.
            return [f"waiting {seconds:.6f}" if self.grant(seconds) else "not implemented"]
        return self.write(name, word)

    # Errors and properties

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
            return declared.show(self.error if name == "error" else 24.0)  # 24 V, the supply
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


def _for_axis(command: Callable[..., list[str]], least: int) -> Callable[[str], list[str]]:
    """Return a command on a line whose leading numbers, at least ``least``, begin with an axis."""

    def carry_out(text: str) -> list[str]:
        found: list[float] = []  # leading numbers after the command's letter
        for word in text[1:].split():
            if (value := FLOAT.scan(word)) is None:
                break
            found.append(value)
        if len(found) < least:
            return ["invalid command format"]
        if found[0] not in (0, 1):
            return [f"invalid motor {int(found[0])}"]
        return command(int(found[0]), *found[1:])

    return carry_out


def _checksum(text: str) -> int:
    """Return the exclusive or of a line's bytes."""
    return functools.reduce(operator.xor, text.encode("latin-1"), 0)
