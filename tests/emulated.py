"""Arms without inertia for emulated controllers: as a plant, and behind a serial port."""

import numpy as np


class Encoders:
    """Encoders that are where an emulator's reference is, or stay put; `firmware` is to be set.

    Two axes without switches, whose motors have torques [V] that a test sets.
    """

    def __init__(self, counts=(0, 0), home=(0, 0)):
        self.counts, self.home = list(counts), home
        self.follows = True
        self.torques = 0.0, 0.0
        self.driven = None

    def encoder_counts(self):
        return self.counts[0], self.counts[1]

    def home_counts(self):
        return self.home

    def torque_volts(self):
        return self.torques

    def index(self, axis):
        return None

    def active(self, switch, axis):
        return False

    def amplifier_fault(self, axis):
        return False

    def drive(self, offsets, limits):
        self.driven = offsets, limits

    def tick(self, times=1):
        for _ in range(times):
            self.firmware.tick()
            self.move()

    def move(self):
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
