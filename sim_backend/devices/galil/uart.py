"""A serial line that takes its time, and its input buffer."""

from collections import deque

BITS = 10  # Bits of one character, with its start and stop bit


class Uart:
    """Characters under way in both directions, in simulated time.

    Args:
        baud_rate: Bits per second.
        buffer: Characters that wait while the controller is busy; later ones are lost.
    """

    def __init__(self, baud_rate: int, buffer: int) -> None:
        self._time, self._buffer = BITS / baud_rate, buffer
        self._in: deque[tuple[float, int]] = deque()
        self._out: deque[tuple[float, int]] = deque()
        self._in_free = self._out_free = 0.0

    @property
    def busy(self) -> bool:
        """Whether characters are under way or wait."""
        return bool(self._in or self._out)

    def send(self, data: bytes, now: float) -> None:
        """Send bytes from the host at a time [s]."""
        for byte in data:
            self._in_free = max(self._in_free, now) + self._time
            self._in.append((self._in_free, byte))

    def write(self, data: bytes, now: float) -> None:
        """Send bytes to the host at a time [s]."""
        for byte in data:
            self._out_free = max(self._out_free, now) + self._time
            self._out.append((self._out_free, byte))

    def overflowed(self, now: float) -> bool:
        """Drop what has arrived by a time [s] and does not fit; return whether there was any."""
        arrived = sum(1 for time, _ in self._in if time <= now)
        if arrived <= self._buffer:
            return False
        kept = [each for i, each in enumerate(self._in) if not self._buffer <= i < arrived]
        self._in = deque(kept)
        return True

    def next_byte(self, now: float) -> bytes:
        """Return the next byte that has arrived by a time [s], if any."""
        if self._in and self._in[0][0] <= now:
            return bytes((self._in.popleft()[1],))
        return b""

    def delivered(self, now: float) -> bytes:
        """Return the bytes that have reached the host by a time [s]."""
        bytes_out = bytearray()
        while self._out and self._out[0][0] <= now:
            bytes_out.append(self._out.popleft()[1])
        return bytes(bytes_out)
