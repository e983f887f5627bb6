"""Shared by all tests: a server of commands, and sessions made of one press of the stand-in.

Fixtures import what they need, since the process that starts the workers of xdist needs none of it.
"""

import gc
import importlib
import os
import signal
import sys
import tempfile
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

# As the commands do: other threads of BLAS wait in busy loops, which slows the other workers.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# A server of one test must not be forked into the commands of the next: gRPC's handlers abort then.
os.environ.setdefault("GRPC_ENABLE_FORK_SUPPORT", "0")

import pytest
from hypothesis import settings

from tests import budget  # noqa: F401 (it registers the profiles)
from tests.forked import CommandServer
from tests.pages import Page, read_page

SLOW_TIMEOUT = 1800  # s, for studies of a minute or more, on machines that others use as well


def pytest_configure(config: pytest.Config) -> None:
    """Let hypothesis try many examples where slow tests are selected; collect garbage rarely."""
    gc.set_threshold(50_000)  # imports and tests make many objects that stay
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as a shell starts what runs behind it
        signal.signal(signal.SIGINT, signal.default_int_handler)
    settings.load_profile("few" if config.option.markexpr == "not slow" else "many")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put last what compiled simulators run: one worker compiles them, while another one tests.

    Slow tests get a longer time, unless they have their own.
    """
    for item in items:
        if item.get_closest_marker("slow") and not item.get_closest_marker("timeout"):
            item.add_marker(pytest.mark.timeout(SLOW_TIMEOUT))
    compiled = ("sim_backend", "analysis", "test_independent.py")
    root = Path(__file__).parent
    items.sort(key=lambda item: item.path.relative_to(root).parts[0] in compiled)


def pytest_collection_finish() -> None:
    """Exclude what all modules hold from every later search for garbage."""
    gc.collect()
    gc.freeze()


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
    from sautereau.rig.load import load_rig

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


@pytest.fixture
def follow(tmp_path, monkeypatch, install):
    """Write the files of a page into the working folder, and install its package as pip does.

    A rig file on a page has one table of those in the packaged one.
    """
    written = []

    def on(name: str, *groups: str, installed: bool = True) -> Page:
        page = read_page(name)
        files = {block.title: block.body for block in page.blocks if block.title}
        if "my-rig.toml" in files:
            table = files["my-rig.toml"].partition("\n")[0] + "\n"
            text = resources.files("sautereau.rig").joinpath("paper.toml").read_text("utf-8")
            files["my-rig.toml"] = text.replace(table, files["my-rig.toml"], 1)
        for title, body in files.items():
            (tmp_path / title).write_text(body, encoding="utf-8")
        if installed:
            project = tomllib.loads(files["pyproject.toml"])["project"]
            install(tmp_path, project, *groups)
        monkeypatch.chdir(tmp_path)
        written.extend(Path(title).stem for title in files)
        return page

    yield on
    for name in written:
        sys.modules.pop(name, None)


@pytest.fixture(scope="session")
def write_session():
    """Write sessions from one press of the scene `ideal`, simulated without the devices."""
    from tests.sessions import session_writer

    return session_writer()
