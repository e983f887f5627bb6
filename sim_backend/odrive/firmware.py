"""The ASCII protocol of the emulated ODrive, byte by byte, and its clock.

Lines end with a line feed, a carriage return or `!`; what follows a `;` is a comment. A line
with a checksum (`*` and the exclusive or of the bytes before it) is answered with one, and
ignored where it is wrong. Only questions and refused lines are answered.

Two properties are the stand-in's own, for no stock firmware has them: `gpio1.state` to
`gpio8.state` set a digital output, and `stand_in.wait` lets simulated time go on
(docs/decisions/0006).
"""

from collections.abc import Callable

import numpy as np

from sim_backend.galil.machine import Plant
from sim_backend.odrive.axis import TORQUE_CONSTANT, OdriveAxis
from trajectory.motion import Floats

_LINE = 256
"""Bytes of a line that the firmware takes; a longer one is lost to its end."""
_ANSWER = 63
_VALUE = 9
"""Characters of a property's value."""
_OUTPUTS = 8
_SUPPLY = 24.0  # V
_LARGEST = 1e6
"""Of a number that a setting takes here: what is more is no setting of this bench."""


class OdriveFirmware:
    """A controller at power-up: motors off, outputs low.

    It is not safe for threads; see `GalilFirmware`.

    Args:
        plant: What motors and encoders are wired to.
        per_turn: Encoder counts a turn of each motor.
        period: s, of one sample of the bench.
        stepped: Whether time waits for the host while the trigger's output is high.
        trigger: Number of that output.
        torque_per_volt: N m of each motor that the plant's commands [V] stand for.
        on_output: Called with number (from 1) and level when a digital output changes.
    """

    def __init__(
        self,
        plant: Plant,
        *,
        per_turn: tuple[float, float],
        period: float,
        stepped: bool,
        trigger: int,
        torque_per_volt: tuple[float, float],
        on_output: Callable[[int, bool], None],
    ):
        self._torque_per_volt = torque_per_volt
        self._plant, self._period, self._stepped = plant, period, stepped
        self._trigger, self._on_output = trigger, on_output
        self.axes = [
            OdriveAxis(*values)
            for values in zip(per_turn, plant.encoder_counts(), plant.home_counts(), strict=True)
        ]
        self._outputs = [False] * _OUTPUTS
        self._granted = 0
        self._line = bytearray()
        self._commands: dict[str, Callable[[str], list[str]]] = {
            "p": self._position,
            "t": self._trajectory,
            "f": self._feedback,
            "i": self._information,
            "r": self._read,
            "w": self._write,
            "u": self._update,
            "s": self._system,
        }

    @property
    def motors_on(self) -> tuple[bool, bool]:
        """Whether each axis is powered."""
        first, second = self.axes
        return first.on, second.on

    @property
    def held(self) -> bool:
        """Whether time waits for the host: it streams setpoints."""
        return self._stepped and self._outputs[self._trigger - 1] and not self._granted

    @property
    def moving(self) -> bool:
        """Whether time must go on, because a setpoint changes or the host waits."""
        if self.held:
            return False
        return self._granted > 0 or any(axis.moving for axis in self.axes)

    @property
    def watching(self) -> bool:
        """Whether a watchdog runs while its motor is on."""
        return any(axis.watched for axis in self.axes)

    def tick(self) -> None:
        """Do one sample of the bench."""
        streamed = self._granted > 0 and self._outputs[self._trigger - 1]
        self._granted = max(0, self._granted - 1)
        plant = self._plant
        for axis, raw, home in zip(
            self.axes, plant.encoder_counts(), plant.home_counts(), strict=True
        ):
            axis.look(raw, home, self._period)
            if streamed or not self._stepped:
                axis.watch(self._period)
            else:  # the host is infinitely slow, and not dead
                axis.feed()
            axis.step(self._period)

    def reference(self, fractions: Floats) -> tuple[Floats, Floats]:
        """Return the reference within the sample last ticked; see `GalilFirmware`."""
        positions, velocities = [], []
        (a0, a1, a2, a3), (b0, b1, b2, b3) = (axis.cubic for axis in self.axes)
        for f in fractions.tolist():  # in plain floats: numpy takes longer for the few there are
            positions.append((a0 + f * (a1 + f * (a2 + f * a3)), b0 + f * (b1 + f * (b2 + f * b3))))
            velocities.append((a1 + f * (2 * a2 + 3 * f * a3), b1 + f * (2 * b2 + 3 * f * b3)))
        return np.array(positions), np.array(velocities)

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
        text, star, told = line.partition(";")[0].partition("*")
        if star and not (told.strip().isdecimal() and int(told) == _checksum(text)):
            return b""
        if not text:
            return b""
        command = self._commands.get(text[0])
        answers = command(text) if command else ["unknown command"]
        answer = ""
        for each in answers:
            each = each[:_ANSWER]
            answer += f"{each}*{_checksum(each)}\r\n" if star else f"{each}\r\n"
        return answer.encode("latin-1")

    def _position(self, text: str) -> list[str]:
        numbers = _numbers(text)
        if len(numbers) < 2:
            return ["invalid command format"]
        if refused := _no_axis(numbers[0]):
            return refused
        axis = self.axes[int(numbers[0])]
        axis.follow(numbers[1], numbers[2] if len(numbers) > 2 else None)
        return []

    def _trajectory(self, text: str) -> list[str]:
        numbers = _numbers(text)
        if len(numbers) < 2:
            return ["invalid command format"]
        if refused := _no_axis(numbers[0]):
            return refused
        self.axes[int(numbers[0])].move(numbers[1])
        return []

    def _feedback(self, text: str) -> list[str]:
        numbers = _numbers(text)
        if not numbers:
            return ["invalid command format"]
        if refused := _no_axis(numbers[0]):
            return refused
        number = int(numbers[0])
        axis = self.axes[number]
        axis.raw = self._plant.encoder_counts()[number]
        return [f"{axis.position:.6f} {axis.velocity:.6f}"]

    def _update(self, text: str) -> list[str]:
        numbers = _numbers(text)
        if not numbers:
            return ["invalid command format"]
        if refused := _no_axis(numbers[0]):
            return refused
        self.axes[int(numbers[0])].feed()
        return []

    def _information(self, text: str) -> list[str]:
        pace = "stepped" if self._stepped else "paced"
        return [
            "Hardware version: 3.6-56V",
            "Firmware version: 0.5.6",
            f"Serial number: SIM sautereau stand-in, {pace}",
        ]

    def _system(self, text: str) -> list[str]:
        if text[1:2] == "c":
            for axis in self.axes:
                axis.error = 0
        return []

    def _read(self, text: str) -> list[str]:
        words = text.split()
        if len(words) < 2:
            return ["invalid command format"]
        value = self._value(words[1])
        return ["invalid property" if value is None else value[:_VALUE]]

    def _value(self, name: str) -> str | None:
        if (output := _output(name)) is not None:
            return str(int(self._outputs[output - 1]))
        if name == "vbus_voltage":
            return f"{_SUPPLY:.6f}"
        axis, rest = self._named(name)
        if axis is None:
            return None
        if rest == "motor.current_control.Iq_setpoint":
            number = self.axes.index(axis)
            torque = self._plant.torque_volts()[number] * self._torque_per_volt[number]
            return f"{torque / TORQUE_CONSTANT:.6f}"
        whole = {
            "current_state": axis.state,
            "error": axis.error,
            "motor.error": 0,
            "encoder.error": 0,
            "controller.error": 0,
            "controller.trajectory_done": axis.done,
            "is_homed": axis.homed,
            "min_endstop.endstop_state": axis.pressed,
        }
        if rest in whole:
            return str(int(whole[rest]))
        if rest not in axis.settings:
            return None
        value = axis.settings[rest]
        return str(int(value)) if rest in _WHOLE else f"{value:.6f}"

    def _write(self, text: str) -> list[str]:
        words = text.split()
        if len(words) < 2:
            return ["invalid command format"]
        name, value = words[1], _number(words[2]) if len(words) > 2 else None
        if name == "stand_in.wait":
            return self._wait(value)
        output = _output(name)
        axis, rest = self._named(name)
        known = output is not None or (
            axis is not None and (rest == "requested_state" or rest in axis.settings)
        )
        if not known:
            return ["invalid property"]
        if value is None:
            return ["not implemented"]
        if output is not None:
            self._set_output(output, value != 0)
        elif axis is not None and rest == "requested_state":
            axis.request(int(value))
        elif axis is not None:
            axis.settings[rest] = float(int(value)) if rest in _WHOLE else value
            if rest == "config.watchdog_timeout":
                axis.feed()
            axis.look_at_endstop()
        return []

    def _wait(self, seconds: float | None) -> list[str]:
        """Let time go on; answered, so that the host says nothing before it has gone."""
        if seconds is None or not self._stepped or not 0 <= seconds <= 60:
            return ["not implemented"]
        self._granted += max(1, round(seconds / self._period))
        return [f"waiting {seconds:.6f}"]

    def _set_output(self, number: int, level: bool) -> None:
        if self._outputs[number - 1] != level:
            self._outputs[number - 1] = level
            self._on_output(number, level)

    def _named(self, name: str) -> tuple[OdriveAxis | None, str]:
        """Return the axis that a property's name begins with, and the rest of the name."""
        head, _, rest = name.partition(".")
        for number, axis in enumerate(self.axes):
            if head == f"axis{number}":
                return axis, rest
        return None, ""


_WHOLE = frozenset(
    {
        "config.enable_watchdog",
        "controller.config.circular_setpoints",
        "controller.config.control_mode",
        "controller.config.input_mode",
        "encoder.config.cpr",
        "min_endstop.config.enabled",
    }
)


def _checksum(text: str) -> int:
    found = 0
    for byte in text.encode("latin-1"):
        found ^= byte
    return found


def _number(word: str) -> float | None:
    """Return a number, or None for what is none or too large for this bench."""
    try:
        value = float(word)
    except ValueError:
        return None
    return value if abs(value) <= _LARGEST * 1e4 else None


def _numbers(text: str) -> list[float]:
    """Return the leading numbers behind a command's letter."""
    found = []
    for word in text[1:].split():
        if (value := _number(word)) is None:
            break
        found.append(value)
    return found


def _no_axis(number: float) -> list[str]:
    return [] if number in (0, 1) else [f"invalid motor {int(number)}"]


def _output(name: str) -> int | None:
    """Return the number of the output that a property is the level of."""
    number = name.removeprefix("gpio").removesuffix(".state")
    if name != f"gpio{number}.state" or number not in "12345678" or len(number) != 1:
        return None
    return int(number)
