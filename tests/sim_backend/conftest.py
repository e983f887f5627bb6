"""A controller on a bench without inertia, and served cards, for the tests of the devices."""

import contextlib

import numpy as np
import pytest

from sautereau.sim_backend.devices.galil.firmware import GalilFirmware
from tests.cards import served
from tests.emulated import Encoders


class BareBench(Encoders):
    """A Galil controller on such an arm, with switches and an index, and its host's line."""

    def __init__(self, unit=None, **options):
        super().__init__(home=(1500, -700))
        self.outputs, self.firmware = [], None
        self.torques = 0.5, -1.25
        self.closed, self.broken = set(), set()
        self.indices = [None, None]
        self.positions, self.velocities = [], []
        self.firmware = GalilFirmware(self, unit, on_output=self._note_output, **options)
        self.firmware.receive(b"EO 0\r")

    def active(self, switch, axis):
        if switch == "home":
            return self.counts[axis] < self.home[axis]
        return (switch, axis) in self.closed

    def index(self, axis):
        """Every 4000 counts from 100 on, if it has passed since the last tick."""
        return self.indices[axis]

    def amplifier_fault(self, axis):
        return axis in self.broken

    def _note_output(self, number, level):
        at = self.firmware.samples if self.firmware else 0
        self.outputs.append((at, number, level))

    def send(self, text):
        return self.firmware.receive(text.encode("latin-1") + b"\r").decode("latin-1")

    def load(self, *lines, end="\\\r"):
        """Download a program; return the answer."""
        return self.firmware.receive(("DL\r" + "\r".join(lines) + "\r" + end).encode()).decode()

    def accept(self, *lines):
        for line in lines:
            answer = self.send(line)
            assert set(answer) == {":"}, f"{line!r} answered {answer!r}, {self.send('TC1')}"

    def refusal(self, line):
        assert self.send(line).endswith("?")
        return int(self.send("TC1").split()[0])

    def number(self, expression):
        self.firmware.receive(b"")
        answer = self.send(f"MG {expression}")
        assert answer.endswith("\r\n:"), (expression, answer)
        return float(answer[:-3])

    def move(self):
        positions, velocities = self.firmware.reference(np.array([0.0, 0.5, 1.0]))
        self.positions.append(positions)
        self.velocities.append(velocities)
        if self.follows:
            before, self.counts = self.counts, [round(value) for value in positions[-1]]
            for axis, (old, new) in enumerate(zip(before, self.counts, strict=True)):
                low, high = sorted(((old - 100) // 4000, (new - 100) // 4000))
                self.indices[axis] = high * 4000 + 100 if low != high else None

    def assert_smooth(self):
        """Position and velocity are continuous from one sample to the next."""
        positions, velocities = np.array(self.positions), np.array(self.velocities)
        np.testing.assert_allclose(positions[1:, 0], positions[:-1, 2], atol=1e-6)
        np.testing.assert_allclose(velocities[1:, 0], velocities[:-1, 2], atol=1e-9)


@pytest.fixture
def bench():
    return BareBench()


@pytest.fixture(scope="session")
def make_bench():
    """For tests that need a fresh bench for every example."""
    return BareBench


@pytest.fixture
def serve():
    """Return a function that serves a card until the test ends; see `served`."""
    with contextlib.ExitStack() as stack:
        yield lambda card, *options: stack.enter_context(served(card, *options))
