"""A DAQ card of seeded noise behind the real gRPC server, for the real nidaqmx."""

import threading
from pathlib import Path

import numpy as np
import pytest

from sautereau.daq.convert.importing import import_file
from sautereau.daq.convert.options import ImportOptions
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import Joints
from sautereau.daq.file.recording import Block, Recording, SessionInfo
from sautereau.rig.load import with_values
from sautereau.sim_backend.devices.daqmx.server import DaqmxServer
from tests.cards import Card
from tests.recordings import write_recording


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
        card = card or Card()
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

    def write(path: Path, volts, block=1024, clock=lambda: 1_700_000_000_000_000_000, **options):
        options |= {"block": block, "session": session, "clock": clock}
        return write_recording(path, paper, volts, **options)

    return write


STATED = {
    "trigger": "0 s",
    "started": "2026-02-03T04:05:06+01:00",
    "simulated": False,
    "without": ("force",),
}
"""Options of an import that its file need not state."""


@pytest.fixture
def bring(tmp_path, paper):
    """Write a file, if there is content, import it, and return the answer and the recording."""

    def bring(content, name="table.csv", *, notes="", **given):
        path, out = tmp_path / name, tmp_path / "back.mcap"
        if isinstance(content, str | bytes):
            path.write_bytes(content.encode() if isinstance(content, str) else content)
        options = ImportOptions(**(STATED | given))
        done = import_file(path, out, rig=paper, options=options, notes=notes)
        return done, read_recording(out)

    return bring


@pytest.fixture
def refused(bring, tmp_path):
    """Return a function that expects `bring` to be refused, and returns the message."""

    def refused(content, name="table.csv", **given):
        before = set(tmp_path.glob("*.mcap"))
        with pytest.raises(RecordingError) as caught:
            bring(content, name, **given)
        assert set(tmp_path.glob("*.mcap")) == before
        return str(caught.value)

    return refused


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
        recording.event("motion", "started", 1.2e-3, 3e-5)
        recording.write_joints(Joints(t, t + 4, t + 5))
    return path
