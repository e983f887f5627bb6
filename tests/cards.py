"""A DAQ card whose inputs and readiness a test sets, for the server of the real nidaqmx."""

import contextlib
import threading

import grpc
import numpy as np
import pytest
from nidaqmx import DaqError, GrpcSessionOptions

from sautereau.sim_backend.device_types import IDEAL
from sautereau.sim_backend.devices.daqmx.card import DaqmxError, Module
from sautereau.sim_backend.devices.daqmx.server import DaqmxServer


def volts(first, n, channels=1):
    """Return what a card measures [V], shape (channels, n): no pattern, all bits in use."""
    index = np.arange(first, first + n) + 1_000_000 * np.arange(channels)[:, None]
    mixed = index.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15) >> np.uint64(11)
    return 20 * 2.0**-53 * mixed - 10


class CardRun:
    """One acquisition."""

    def __init__(self, card, setup):
        self.card, self.setup = card, setup
        self.stopped = threading.Event()
        self.asked = 0
        """How often the host asked for the number of samples."""

    def wait_for(self, n, timeout):
        ready = self.setup.n_samples if self.card.ready is None else self.card.ready
        there = ready(n) if callable(ready) else ready
        if there < n:
            self.stopped.wait(timeout)
        return there

    def read(self, first, n):
        if self.card.fault and first + n > self.card.fault[0]:
            raise DaqmxError(self.card.fault[1], "The driver's text.")
        return self.card.volts(first, n, len(self.setup.terminals))

    @property
    def acquired(self):
        self.asked += 1
        return self.card.acquired(self)

    def stop(self):
        self.stopped.set()


class Card:
    """A card; `ready` are the samples that are there, None for all, or a function of those due.

    At the sample `fault[0]` it fails with the code `fault[1]`. It measures what `measured` returns.
    """

    def __init__(
        self, inputs=2, *, ready=None, fault=None, paced=True, device=IDEAL, measured=volts
    ):
        self.volts = measured
        name, chassis = ("cDAQ1Mod1", "cDAQ1") if device.in_chassis else ("Dev1", "")
        self.modules = (Module(name, device, tuple(f"ai{n}" for n in range(inputs)), chassis),)
        self.ready, self.fault, self.paced = ready, fault, paced
        self.acquired = lambda run: run.wait_for(0, 0)
        self.runs = []

    def check(self):
        """It stays connected."""

    @property
    def setups(self):
        return [run.setup for run in self.runs]

    def start(self, setup):
        self.runs.append(CardRun(self, setup))
        return self.runs[-1]


@contextlib.contextmanager
def served(card, *options):
    """Serve a card; yield what its client needs, with options of the channel."""
    with DaqmxServer(card) as server, grpc.insecure_channel(server.address, options) as channel:
        yield GrpcSessionOptions(channel, "")


def code_of(function, *arguments, **named):
    """Return the code of the driver's error that a call raises."""
    with pytest.raises(DaqError) as caught:
        function(*arguments, **named)
    return caught.value.error_code
