"""Arms without inertia for emulated controllers: as a plant, and behind a serial port."""

import numpy as np


class Encoders:
    """Encoders that are where an emulator's reference is, or stay put; `firmware` is to be set."""

    def __init__(self, counts=(0, 0), home=(0, 0)):
        self.counts, self.home = list(counts), home
        self.follows = True

    def encoder_counts(self):
        return self.counts[0], self.counts[1]

    def home_counts(self):
        return self.home

    def tick(self, times=1):
        for _ in range(times):
            self.firmware.tick()
            positions, _ = self.firmware.reference(np.array([1.0]))
            if self.follows:
                self.counts = [round(value) for value in positions[0]]

    def run(self, limit=20_000):
        for tick in range(limit):
            if not self.firmware.moving:
                return tick
            self.tick()
        raise AssertionError("does not come to an end")


class ScriptedPort:
    """A serial port on which a test says what comes in; a `fault` is raised."""

    def __init__(self, incoming=b""):
        self.incoming, self.fault, self.closed = incoming, None, False

    def open(self, name, baud_rate, timeout):
        return self

    @property
    def in_waiting(self):
        return len(self.incoming)

    def read(self, size=1):
        if self.fault:
            raise self.fault
        data, self.incoming = self.incoming[:size], self.incoming[size:]
        return data

    def write(self, data):
        return len(data)

    def reset_input_buffer(self):
        self.incoming = b""

    def close(self):
        self.closed = True


class EmulatedPort(Encoders, ScriptedPort):
    """A serial port, and behind it an emulated controller."""

    def __init__(self, counts):
        Encoders.__init__(self, counts)
        ScriptedPort.__init__(self)

    def write(self, data):
        if self.fault:
            raise self.fault
        self.exchange(bytes(data))
