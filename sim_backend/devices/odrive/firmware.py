"""The ASCII protocol of the emulated ODrive, byte by byte.

Lines end with a line feed, a carriage return or `!`; a `;` starts a comment. A line with a
checksum (`*` and the exclusive or of the bytes before it) is answered with one, and ignored if
the checksum is wrong. Only queries and refused lines are answered; an empty line is refused too.

After `Firmware/communication/ascii_protocol.cpp` of odriverobotics/ODrive, tag fw-v0.5.6, without
its commands q, v, c, e and h, and without those that save and reboot. Its properties include no
pin of the device, so that nothing sets an output.

One property is the stand-in's own: `stand_in.wait` advances simulated time (docs/decisions/0006).
"""

import functools
import operator
from collections.abc import Callable
from typing import Any

from sautereau.rig.schema import Rig
from sautereau.sim_backend.devices.emulators import AMPLIFIER_VOLTS, OnOutput, Plant
from sautereau.sim_backend.devices.odrive.machine import Machine
from sautereau.sim_backend.devices.odrive.properties import FLOAT, single

_LINE = 256  # Largest number of bytes in a line; a longer one is ignored
_ANSWER = 63


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


class OdriveFirmware(Machine):
    """A controller as its serial line shows it; arguments as for `Machine`."""

    def __init__(self, plant: Plant, **given: Any):
        super().__init__(plant, **given)
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
            each = each[:_ANSWER]
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


def _for_axis(command: Callable[..., list[str]], least: int) -> Callable[[str], list[str]]:
    """Return a command on a line whose leading numbers, at least ``least``, begin with an axis."""

    def carry_out(text: str) -> list[str]:
        found = _numbers(text)
        if len(found) < least:
            return ["invalid command format"]
        if found[0] not in (0, 1):
            return [f"invalid motor {int(found[0])}"]
        return command(int(found[0]), *found[1:])

    return carry_out


def _checksum(text: str) -> int:
    """Return the exclusive or of a line's bytes."""
    return functools.reduce(operator.xor, text.encode("latin-1"), 0)


def _numbers(text: str) -> list[float]:
    """Return the leading numbers after a command's letter."""
    found: list[float] = []
    for word in text[1:].split():
        if (value := FLOAT.scan(word)) is None:
            break
        found.append(value)
    return found
