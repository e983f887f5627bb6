"""A bad serial line between the host and the simulated controller."""

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from sautereau.sim_backend.devices.serial_port import PortGone
from sautereau.sim_backend.fault_tables import CableOut, Faults, LineFault

Past = Callable[[int, float], bool]
"""Whether ``at`` s (second argument) have passed since the trigger edge of a press, from 1."""


class BadLine:
    """A serial line with the faults of a scene.

    Args:
        faults: Of the scene.
        seed: Of all random numbers.
        past: Compares the time with that of a press.
    """

    def __init__(self, faults: Faults, seed: int, past: Past):
        self._noise = faults.line or LineFault.model_construct(dropped=0.0, flipped=0.0, delay=0.0)
        self._cable = faults.cable_out
        self._past = past
        self._received = 0
        # Each direction has a generator of its own, for the host decides how they interleave.
        self._random = {
            towards: np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(1, i)))
            for i, towards in enumerate(("controller", "host"))
        }

    @property
    def delay(self) -> float:
        """s of real time, by which an answer is late now."""
        return self._noise.delay if self._noisy else 0.0

    def carry(self, data: bytes, receive: Callable[[bytes], bytes]) -> bytes:
        """Carry bytes to the controller and its answer back.

        Raises:
            PortGone: The port has disappeared with the cable.
        """
        data = self._disturbed(data, "controller")
        allowed = self._allowed(len(data))
        self._received += len(data)
        answer = receive(data[:allowed])
        if allowed < len(data) or self._out(self._cable):
            if self._cable is not None and self._cable.port_closes:
                raise PortGone
            return b""
        return self._disturbed(answer, "host")

    @property
    def _noisy(self) -> bool:
        press = self._noise.press
        return press == 0 or self._past(press, 0.0)

    def _allowed(self, n: int) -> int:
        """Return how many of n bytes the controller still receives."""
        cable = self._cable
        if cable is None:
            return n
        if cable.after_bytes is not None:
            return min(n, max(0, cable.after_bytes - self._received))
        return 0 if self._out(cable) else n

    def _out(self, cable: CableOut | None) -> bool:
        if cable is None:
            return False
        if cable.after_bytes is not None:
            return self._received >= cable.after_bytes
        return cable.press is not None and self._past(cable.press, cable.at)

    def _disturbed(self, data: bytes, towards: str) -> bytes:
        noise = self._noise
        if not data or not self._noisy or noise.towards not in ("both", towards):
            return data
        return disturbed(data, noise.dropped, noise.flipped, self._random[towards])


def bad_line(faults: Faults | None, seed: int, past: Past) -> BadLine | None:
    """Return the line of a scene, or None where it has no faults; arguments of `BadLine`."""
    if faults is None or (faults.line is None and faults.cable_out is None):
        return None
    return BadLine(faults, seed, past)


def disturbed(data: bytes, dropped: float, flipped: float, random: Generator) -> bytes:
    """Return the bytes with some lost and some with one bit inverted.

    Args:
        data: Any bytes; each takes three random numbers.
        dropped: Probability that a byte is lost.
        flipped: Probability that a byte is changed if it is not lost.
        random: Source of the random numbers.
    """
    numbers = random.random((len(data), 3))
    values = np.frombuffer(data, np.uint8)
    bits = np.left_shift(1, (numbers[:, 2] * 8).astype(np.uint8)).astype(np.uint8)
    values = np.where(numbers[:, 1] < flipped, values ^ bits, values)
    return values[numbers[:, 0] >= dropped].tobytes()
