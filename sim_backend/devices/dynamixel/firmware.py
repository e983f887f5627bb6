"""Two emulated servos on one bus: IDs 1 and 2 turn joints 1 and 2.

Instructions as in ROBOTIS's e-Manual, page `dxl/protocol2`: ping, read, write, reboot, sync read
and sync write. Two addresses of servo 1 are the stand-in's own (docs/decisions/0006): `WAIT`
advances simulated time, and while `HOLD` is set time advances only in this way.
"""

from collections.abc import Callable

from sautereau.rig.schema import Rig
from sautereau.sim_backend.devices.dynamixel.packets import BROADCAST, Packet, Receiver, status
from sautereau.sim_backend.devices.dynamixel.servo import ACCESS, CENTRE, TURN, Servo
from sautereau.sim_backend.devices.emulators import OnOutput, Plant
from sautereau.sim_backend.devices.streamed import StreamedController
from sautereau.sim_backend.errors import SceneError

_INSTRUCTION, _CRC = 2, 3  # error numbers
WAIT, HOLD = 1000, 1004
"""Addresses of the stand-in: us to wait, 4 bytes; whether time is held, 1 byte."""


def emulate(rig: Rig, plant: Plant, _on_output: OnOutput, paced: bool) -> "Servos":
    """Return the servos at power-up; see `EMULATORS`.

    Raises:
        SceneError: The rig's encoders are not those of such servos.
    """
    if rig.arm.counts_per_revolution != TURN:
        raise SceneError(
            f"arm.counts_per_revolution: {rig.arm.counts_per_revolution}, and these servos have"
            f" {TURN}; correct the rig file"
        )
    return Servos(plant, rig.controller.sample_period, stepped=not paced)


class Servos(StreamedController[Servo]):
    """The bus as the host sees it; arguments as for `StreamedController`."""

    def __init__(self, plant: Plant, period: float, *, stepped: bool):
        super().__init__(plant, period, stepped=stepped)
        raw, home = plant.encoder_counts(), plant.home_counts()
        information = b"SIM" + (b"s" if stepped else b"p")
        self.axes = [
            Servo(axis + 1, home[axis] - CENTRE, raw[axis], information) for axis in (0, 1)
        ]
        self._receiver = Receiver()
        self._holding = False
        self._instructions: dict[int, Callable[[list[Servo], Packet], bytes]] = {
            0x01: self._ping,
            0x02: self._read,
            0x03: self._write,
            0x08: self._reboot,
            0x82: self._sync_read,
            0x83: self._sync_write,
        }

    @property
    def streaming(self) -> bool:
        return self._holding

    def receive(self, data: bytes) -> bytes:
        """Take bytes from the host; return what the servos send back."""
        return b"".join(map(self._carry_out, self._receiver.feed(data)))

    def _carry_out(self, packet: Packet) -> bytes:
        for servo, raw in zip(self.axes, self.plant.encoder_counts(), strict=True):
            servo.raw = raw
        meant = [servo for servo in self.axes if packet.servo in (servo.number, BROADCAST)]
        if not packet.intact:
            return b"".join(status(servo.number, _CRC | servo.alert) for servo in meant)
        for servo in self.axes:
            servo.hear()
        known = self._instructions.get(packet.instruction)
        if known is None:
            return b"".join(status(servo.number, _INSTRUCTION | servo.alert) for servo in meant)
        return known(meant, packet)

    def _ping(self, meant: list[Servo], packet: Packet) -> bytes:
        answers = [(servo, servo.read(0, 2), servo.read(6, 1)) for servo in meant]
        return b"".join(_answer(servo, model, version) for servo, model, version in answers)

    def _read(self, meant: list[Servo], packet: Packet) -> bytes:
        if packet.servo == BROADCAST:
            return b""
        address, length = _pair(packet.parameters)
        return b"".join(_answer(servo, servo.read(address, length)) for servo in meant)

    def _write(self, meant: list[Servo], packet: Packet) -> bytes:
        address, data = int.from_bytes(packet.parameters[:2], "little"), packet.parameters[2:]
        errors = [self._written(servo, address, data) for servo in meant]
        if packet.servo == BROADCAST:
            return b""
        pairs = zip(meant, errors, strict=True)
        return b"".join(status(servo.number, error | servo.alert) for servo, error in pairs)

    def _written(self, servo: Servo, address: int, data: bytes) -> int:
        value = int.from_bytes(data, "little")
        if servo.number == 1 and address == WAIT and self.grant(value * 1e-6):
            return 0
        if self.stepped and servo.number == 1 and address == HOLD:
            self._holding = bool(value)
            return 0
        return servo.write(address, data) if data else ACCESS

    def _reboot(self, meant: list[Servo], packet: Packet) -> bytes:
        for servo in meant:
            servo.reboot()
        return b"".join(status(servo.number, 0) for servo in meant)

    def _sync_read(self, meant: list[Servo], packet: Packet) -> bytes:
        address, length = _pair(packet.parameters)
        by_number = {servo.number: servo for servo in self.axes}
        named = [by_number[n] for n in packet.parameters[4:] if n in by_number]
        return b"".join(_answer(servo, servo.read(address, length)) for servo in named)

    def _sync_write(self, meant: list[Servo], packet: Packet) -> bytes:
        address, length = _pair(packet.parameters)
        by_number = {servo.number: servo for servo in self.axes}
        rest = packet.parameters[4:]
        for start in range(0, len(rest), length + 1):
            servo, data = by_number.get(rest[start]), rest[start + 1 : start + 1 + length]
            if servo is not None and len(data) == length:
                servo.write(address, data)
        return b""


def _pair(parameters: bytes) -> tuple[int, int]:
    """Return address and length at the head of parameters."""
    return int.from_bytes(parameters[:2], "little"), int.from_bytes(parameters[2:4], "little")


def _answer(servo: Servo, *parts: bytes | int) -> bytes:
    """Return the status packet of what was read, or of the error instead of it."""
    errors = [part for part in parts if isinstance(part, int)]
    data = b"".join(part for part in parts if isinstance(part, bytes))
    return status(servo.number, (errors[0] if errors else 0) | servo.alert, b"" if errors else data)
