"""Complete presses: real pyserial and real nidaqmx against the stand-in, files on disk."""

import json
import re
import shutil
import subprocess
import sys
import warnings
from importlib import resources
from pathlib import Path

import pytest

from sautereau.commands.app import main
from sautereau.rig.load import load_rig, with_values
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.scene import load_scene
from tests.forked import unwrapped
from tests.presses import MUTE_TEXT, QUICK, QUICK_TEXT, press_on


@pytest.fixture
def quick_rig():
    """The paper's rig with the values `QUICK`."""
    return with_values(load_rig(), QUICK)


@pytest.fixture
def bare(tmp_path):
    """Scene file of a key without strings, for tests that need no pluck."""
    path = tmp_path / "bare.toml"
    path.write_text(MUTE_TEXT)
    return path


@pytest.fixture(scope="session")
def servo(tmp_path_factory):
    """Scene file of the scene `paper`, with longer steps."""
    text = resources.files("sautereau.sim_backend").joinpath("scenes/paper.toml").read_text("utf-8")
    path = tmp_path_factory.mktemp("scene") / "servo.toml"
    longer = text.replace('step = "100 us"', 'step = "500 us"')
    assert longer != text
    path.write_text(longer, encoding="utf-8")
    return path


def run_on_stand_in(scene: str, out: Path, n: int = 1, seed: int = 0, rig=None):
    """Run n presses; return the recordings and the true events."""
    rig = rig or with_values(load_rig(), QUICK)
    with StandIn(rig, load_scene(scene), seed) as stand_in:
        return press_on(stand_in, out, n), stand_in.truth()


@pytest.fixture(scope="session")
def bench():
    """`run_on_stand_in`."""
    return run_on_stand_in


@pytest.fixture(scope="session")
def ideal(tmp_path_factory):
    """Two presses of the scene `ideal`."""
    return run_on_stand_in("ideal", tmp_path_factory.mktemp("ideal"), 2)


@pytest.fixture
def rig_file(tmp_path):
    """Write the rig with the values `QUICK` and lines replaced: rig_file(port='"..."')."""

    def write(**changes: str) -> Path:
        text = QUICK_TEXT
        for key, value in changes.items():
            text, n = re.subn(
                rf"(?m)^{key} = .*$", lambda _, k=key, v=value: f"{k} = {v}", text, count=1
            )
            assert n == 1, key
        path = tmp_path / "rig.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.fixture
def sautereau(command_server, tmp_path):
    """Run a command in its own process and in `tmp_path`; with --json, check both streams."""

    def run(*words: object, **more: object) -> subprocess.CompletedProcess[str]:
        done = command_server.run(*words, folder=tmp_path, **more)
        if "--json" in words:
            printed = done.stderr if done.returncode else done.stdout
            assert json.loads(printed)["schema"] == 1, printed
            assert done.returncode or "warning" not in done.stderr
        return done

    return run


@pytest.fixture
def refusal(tmp_path, monkeypatch, capsys):
    """Run a command in this process and in `tmp_path`, which ends before it makes anything."""
    monkeypatch.chdir(tmp_path)

    def run(*words: str) -> subprocess.CompletedProcess[str]:
        monkeypatch.setattr(sys, "argv", ["sautereau", *words])
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Cyclopts application invoked without tokens")
            with pytest.raises(SystemExit) as ended:
                main()
        printed = capsys.readouterr()
        return subprocess.CompletedProcess(
            words, ended.value.code, printed.out, unwrapped(printed.err)
        )

    return run


@pytest.fixture(scope="module")
def browser():
    """Chromium, driven by Playwright; tests are skipped without."""
    found = filter(None, map(shutil.which, ("chromium", "chromium-browser", "chrome")))
    if not (chromium := next(found, None)):
        pytest.skip("Chromium is not installed; on Debian: `apt install chromium`")
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        # Chromium's sandbox is not available to root, and this page is trusted.
        browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        yield browser
        browser.close()
