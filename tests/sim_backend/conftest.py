"""A controller on a bench without inertia, shared by the tests of the firmware."""

import numpy as np
import pytest

from sautereau.sim_backend.devices.galil.firmware import GalilFirmware


class BareBench:
    """Encoders that are where the reference is (or stay put), and the host's end of the line."""

    def __init__(self, unit=None, **options):
        self.counts = [0, 0]
        self.follows = True
        self.outputs, self.firmware = [], None
        self.torques = 0.5, -1.25
        self.closed, self.broken = set(), set()
        self.indices = [None, None]
        self.positions, self.velocities = [], []
        self.firmware = GalilFirmware(self, unit, on_output=self._note_output, **options)
        self.firmware.receive(b"EO 0\r")

    def encoder_counts(self):
        return self.counts[0], self.counts[1]

    def home_counts(self):
        return 1500, -700

    def torque_volts(self):
        return self.torques

    def active(self, switch, axis):
        if switch == "home":
            return self.counts[axis] < self.home_counts()[axis]
        return (switch, axis) in self.closed

    def index(self, axis):
        """Every 4000 counts from 100 on, if it has passed since the last tick."""
        return self.indices[axis]

    def amplifier_fault(self, axis):
        return axis in self.broken

    def drive(self, offsets, limits):
        self.driven = offsets, limits

    def _note_output(self, number, level):
        at = self.firmware.samples if self.firmware else 0
        self.outputs.append((at, number, level))

    def send(self, text):
        return self.firmware.receive(text.encode("latin-1") + b"\r").decode("latin-1")

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

    def tick(self, times=1):
        for _ in range(times):
            self.firmware.tick()
            positions, velocities = self.firmware.reference(np.array([0.0, 0.5, 1.0]))
            self.positions.append(positions)
            self.velocities.append(velocities)
            if self.follows:
                before, self.counts = self.counts, [round(value) for value in positions[-1]]
                for axis, (old, new) in enumerate(zip(before, self.counts, strict=True)):
                    low, high = sorted(((old - 100) // 4000, (new - 100) // 4000))
                    self.indices[axis] = high * 4000 + 100 if low != high else None

    def run(self, limit=20_000):
        """Tick until nothing moves; return how many samples that took."""
        start = self.firmware.samples
        while self.firmware.moving:
            self.tick()
            assert self.firmware.samples - start < limit, "does not come to an end"
        return self.firmware.samples - start

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
