"""Shared by all tests: a server of commands, and sessions made of one press of the stand-in."""

import importlib
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import settings

from benchmarks.simulated import acquired
from sautereau.daq.file.recorded import Block, Recorded
from sautereau.daq.file.recording import Recording
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.scene import load_scene
from tests import budget  # noqa: F401 (it registers the profiles)
from tests.forked import CommandServer


@dataclass(frozen=True)
class SessionWriter:
    """Writes recordings that differ in their noise and in their metadata."""

    one: Recorded

    def __call__(
        self,
        folder: Path,
        n: int,
        *,
        first: int = 1,
        rig: Rig | None = None,
        events: tuple[tuple[str, str], ...] = (),
        noise: float = 1e-3,
        scale: float = 1.0,
        **metadata: object,
    ) -> list[Path]:
        """Write n presses into a folder; `noise` is in V, `scale` multiplies all volts."""
        folder.mkdir(parents=True, exist_ok=True)
        paths = []
        rig = rig or self.one.rig
        volts = np.stack([self.one.volts[channel.name] for channel in self.one.rig.daq.channels])
        for number in range(first, first + n):
            random = np.random.default_rng(number)
            session = replace(self.one.session, press=number, item=number, **metadata)
            path = folder / f"press-{number:04d}.mcap"
            with Recording(path, rig, session=session, rate=self.one.rate) as recording:
                noisy = scale * volts + noise * random.standard_normal(volts.shape)
                recording.write_block(Block(self.one.first_sample, noisy))
                recording.event("trigger", "edge on PFI0", 0.0)
                for kind, text in events:
                    recording.event(kind, text, 0.0)
            paths.append(path)
        return paths


def pytest_configure(config: pytest.Config) -> None:
    """Let hypothesis try many examples where slow tests are selected."""
    settings.load_profile("few" if config.option.markexpr == "not slow" else "many")


SERVER = pytest.StashKey[CommandServer]()


def start_server(config: pytest.Config) -> CommandServer:
    """Return the server that starts commands quickly; it runs until the tests end."""
    if SERVER not in config.stash:
        folder = tempfile.TemporaryDirectory(prefix="sautereau-")
        server = config.stash[SERVER] = CommandServer(f"{folder.name}/socket")
        config.add_cleanup(folder.cleanup)
        config.add_cleanup(lambda: server.__exit__())
        server.__enter__()
    return config.stash[SERVER]


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node) -> None:
    """Give all workers of xdist the same server."""
    node.workerinput["server"] = start_server(node.config).path


@pytest.fixture(scope="session")
def command_server(request):
    """Server that starts commands quickly."""
    shared = getattr(request.config, "workerinput", {}).get("server")
    return CommandServer(shared) if shared else start_server(request.config)


@pytest.fixture(scope="session")
def paper():
    """The packaged rig."""
    return load_rig("paper")


@pytest.fixture
def install(monkeypatch):
    """Write what pip writes of a package into a folder, with some or all of its entry points."""

    def write(folder: Path, project: dict[str, Any], *groups: str) -> None:
        name, version, points = project["name"], project["version"], project["entry-points"]
        info = folder / f"{name.replace('-', '_')}-{version}.dist-info"
        info.mkdir(parents=True, exist_ok=True)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
        lines = []
        for group in groups or points:
            lines += [f"[{group}]", *(f"{name} = {place}" for name, place in points[group].items())]
        (info / "entry_points.txt").write_text("\n".join(lines))
        monkeypatch.syspath_prepend(folder)
        importlib.invalidate_caches()

    return write


@pytest.fixture(scope="session")
def write_session() -> SessionWriter:
    """Write sessions from one press of the scene `ideal`, simulated without the devices."""
    rig, scene = load_rig(), load_scene("ideal")
    return SessionWriter(acquired(rig, scene, observe(rig, scene))[0])
