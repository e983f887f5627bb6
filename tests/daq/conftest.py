"""A DAQ card of seeded noise behind the real gRPC server, for the real nidaqmx."""

import threading
from pathlib import Path

import numpy as np
import pytest

from sautereau.daq.file.recorded import Joints
from sautereau.daq.file.recording import Block, Recording, SessionInfo
from sautereau.rig.load import load_rig, with_values
from sautereau.sim_backend.devices.daqmx.card import DaqmxError, TaskSetup
from sautereau.sim_backend.devices.daqmx.server import DaqmxServer


class NoiseRun:
    """Samples that are there at once, as many as ``ready``."""

    def __init__(self, volts, ready, fault):
        self.volts, self.ready, self.fault = volts, ready, fault
        self.acquired = ready
        self.stopped = threading.Event()

    def wait_for(self, n, timeout):
        if n > self.ready:
            self.stopped.wait(timeout)
        return self.ready

    def read(self, first, n):
        if self.fault and first + n > self.fault[0]:
            raise DaqmxError(self.fault[1], "The driver's text.")
        return self.volts[:, first : first + n]

    def stop(self):
        self.stopped.set()


class NoiseCard:
    """A card of two inputs; ``ready`` bounds the samples, ``fault`` is (sample, code)."""

    name = "Dev1"
    terminals = ("ai0", "ai1")

    def __init__(self, ready=None, fault=None):
        self.ready, self.fault = ready, fault
        self.runs = []

    def start(self, setup: TaskSetup):
        self.setup = setup
        shape = (len(setup.terminals), setup.n_samples)
        volts = np.random.default_rng(7).uniform(-10, 10, shape)
        ready = setup.n_samples if self.ready is None else self.ready
        self.runs.append(NoiseRun(volts, ready, self.fault))
        return self.runs[-1]


@pytest.fixture(scope="session")
def paper():
    return load_rig("paper")


@pytest.fixture
def velocity(paper):
    return paper.daq.channels[0]


@pytest.fixture
def force(paper):
    return paper.daq.channels[1]


@pytest.fixture
def bench(paper):
    """Serve a card and return it with its server and a rig of its address."""
    servers = []

    def start(card=None, **values):
        card = card or NoiseCard()
        server = DaqmxServer(card)
        server.__enter__()
        servers.append(server)
        values = {key.replace("__", "."): value for key, value in values.items()}
        rig = with_values(
            paper, {"daq.address": server.address, "daq.trigger_timeout": "0.3 s", **values}
        )
        return card, server, rig

    yield start
    for server in servers:
        server.__exit__(None, None, None)
    stray = [t.name for t in threading.enumerate() if t.name.startswith("daqmx stand-in")]
    assert stray == []


@pytest.fixture
def noise_card():
    return NoiseCard


@pytest.fixture(scope="session")
def session():
    return SessionInfo(
        press=3,
        started="2026-02-03T04:05:06+01:00",
        simulated=True,
        controller="DMC-4123",
        daq="sautereau stand-in",
        scene="finger = 'servo'\n",
        seed=11,
        notes="north window open; é",
    )


@pytest.fixture
def volts():
    return np.random.default_rng(1).standard_normal((2, 5000))


@pytest.fixture
def record(paper, session):
    """Write volts in blocks to a finished file and return its path."""

    def write(path: Path, volts, block=1024, clock=lambda: 1_700_000_000_000_000_000):
        with Recording(path, paper, session=session, clock=clock) as recording:
            for first in range(0, volts.shape[1], block):
                recording.write_block(Block(first, volts[:, first : first + block]))
        return path

    return write


@pytest.fixture
def complete_recording(tmp_path, paper, session, volts):
    """A recording with samples, a plan, joints and an event, at a rate of its own."""
    path = tmp_path / "press.mcap"
    t = np.linspace(0, 0.14, 30)
    with Recording(
        path, paper, session=session, rate=51_203.277, clock=lambda: 1_700_000_000_000_000_000
    ) as recording:
        recording.write_plan(t, t + 1, t + 2, t + 3)
        recording.write_block(Block(0, volts))
        recording.event("trigger", "PFI0 rose", 0.0)
        recording.write_joints(Joints(t, t + 4, t + 5))
    return path
