"""Packets of Protocol 2.0: found in a stream of bytes, checked, and made.

After ROBOTIS's e-Manual, page `dxl/protocol2`, headings Instruction Packet, Status Packet, Packet
Process, and `dxl/crc`.
"""

from dataclasses import dataclass

HEADER = b"\xff\xff\xfd"
BROADCAST = 0xFE
STATUS = 0x55
_SHORTEST = 3  # instruction and CRC
_LONGEST = 1024
_POLYNOMIAL = 0x8005


@dataclass(frozen=True)
class Packet:
    """An instruction packet."""

    servo: int
    """ID of the servo, or `BROADCAST`."""
    instruction: int
    parameters: bytes
    intact: bool
    """Whether its CRC is right."""


def crc(data: bytes) -> int:
    """Return the CRC-16 of a packet: polynomial x^16 + x^15 + x^2 + 1, starting at 0."""
    value = 0
    for byte in data:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1) ^ (_POLYNOMIAL if value & 0x8000 else 0)
            value &= 0xFFFF
    return value


def packet(servo: int, instruction: int, parameters: bytes) -> bytes:
    """Return the bytes of a packet; 0xFD is inserted after what looks like a header."""
    body = (bytes([instruction]) + parameters).replace(HEADER, HEADER + b"\xfd")
    data = HEADER + bytes([0, servo]) + (len(body) + 2).to_bytes(2, "little") + body
    return data + crc(data).to_bytes(2, "little")


def status(servo: int, error: int, parameters: bytes = b"") -> bytes:
    """Return a status packet."""
    return packet(servo, STATUS, bytes([error]) + parameters)


class Receiver:
    """Finds the packets in what comes in."""

    def __init__(self) -> None:
        self._received = bytearray()

    def feed(self, data: bytes) -> list[Packet]:
        """Take bytes; return the packets that are complete."""
        self._received += data
        return list(iter(self._next, None))

    def _next(self) -> Packet | None:
        data = self._received
        while True:
            start = data.find(HEADER)
            if start < 0:
                del data[:-2]  # of which the header's first bytes may be
                return None
            del data[:start]
            if len(data) < 7:
                return None
            length = int.from_bytes(data[5:7], "little")
            if data[3] == 0 and data[4] <= BROADCAST and _SHORTEST <= length <= _LONGEST:
                break
            del data[:3]
        if len(data) < 7 + length:
            return None
        whole = bytes(data[: 7 + length])
        del data[: 7 + length]
        body = whole[7:-2].replace(HEADER + b"\xfd", HEADER)
        intact = crc(whole[:-2]) == int.from_bytes(whole[-2:], "little")
        return Packet(whole[4], body[0], body[1:], intact)
