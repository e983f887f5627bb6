"""Wheel and sdist: what is in them, that an empty environment can press with them, the extras."""

import ast
import json
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = ("rig", "trajectory", "daq", "analysis", "sim_backend", "robot")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


BUILD = """
import sys
from setuptools import build_meta
getattr(build_meta, f"build_{sys.argv[1]}")(sys.argv[2])
"""


def run(*words: object, cwd: Path, **options) -> str:
    """Run a command and return what it prints; its errors are the test's."""
    done = subprocess.run(
        [str(word) for word in words],
        cwd=cwd, capture_output=True, text=True, check=False, **options,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def build(source: Path, out: Path) -> tuple[Path, Path]:
    """Return wheel and sdist of a source tree; a copy is built, for setuptools writes into it."""
    left_out = (
        ".git",
        ".venv",
        "build",
        "out",
        "site",
        "*.egg-info",
        "__pycache__",
        "node_modules",
    )
    left_out += ("__pycache__", ".*_cache")
    copy = out / "source"
    shutil.copytree(source, copy, ignore=shutil.ignore_patterns(*left_out))
    for kind in ("sdist", "wheel"):
        run(sys.executable, "-c", BUILD, kind, out, cwd=copy)
    (wheel,), (sdist,) = out.glob("*.whl"), out.glob("*.tar.gz")
    return wheel, sdist


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    return build(ROOT, tmp_path_factory.mktemp("dist"))


def contents(wheel: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def files(folder: Path, root: Path) -> set[str]:
    found = (path for path in folder.rglob("*") if path.is_file())
    return {str(p.relative_to(root)) for p in found if "__pycache__" not in p.parts}


def test_the_wheel_holds_the_rooms_and_nothing_else(built):
    held = {name for name in contents(built[0]) if ".dist-info/" not in name}
    wanted = {str(Path("sautereau", p)) for room in ROOMS for p in files(ROOT / room, ROOT)}
    wanted |= files(ROOT / "sautereau", ROOT)
    assert held == wanted
    assert {"sautereau/rig/paper.toml", "sautereau/sim_backend/scenes/paper.toml"} <= held


def test_the_sdist_is_complete_and_small(built, tmp_path):
    """What is built of it is the same wheel, to the byte."""
    wheel, sdist = built
    with tarfile.open(sdist) as archive:
        names = archive.getnames()
        archive.extractall(tmp_path, filter="data")
    (folder,) = tmp_path.iterdir()
    for name in ("README.md", "LICENSE", "CHANGELOG.md", "Makefile", "tests/test_packaging.py"):
        assert f"{folder.name}/{name}" in names
    assert not [name for name in names if "node_modules" in name or name.endswith(".mcap")]
    assert sdist.stat().st_size < 3e6
    again, _ = build(folder, tmp_path / "again")
    assert contents(again) == contents(wheel)


def test_the_wheel_tells_what_it_is(built):
    held = contents(built[0])
    (metadata,) = (text for name, text in held.items() if name.endswith("/METADATA"))
    told = Parser().parsestr(metadata.decode())
    assert (told["Name"], told["Version"]) == ("sautereau", PROJECT["version"])
    assert set(told.get_all("Provides-Extra", [])) == set(PROJECT["optional-dependencies"])
    (entries,) = (text for name, text in held.items() if name.endswith("/entry_points.txt"))
    assert "sautereau = sautereau.commands.app:main" in entries.decode()


def imported(path: Path) -> set[str]:
    """Return the top names of the modules that a file imports, wherever in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module.split(".")[0])
    return found - set(sys.stdlib_module_names) - {*ROOMS, "sautereau"}


def test_what_is_imported_is_required():
    """Every package imported by a room is a requirement of it, or of an extra."""
    brought_by = {
        "google": "protobuf", "PIL": "pillow", "serial": "pyserial", "skfem": "scikit-fem",
        "foxglove": "foxglove-sdk", "grpc": "nidaqmx", "session_pb2": "nidaqmx",
        "pydantic_core": "pydantic", "markupsafe": "jinja2",
    }  # fmt: skip
    extras = PROJECT["optional-dependencies"].values()
    texts = [*PROJECT["dependencies"], *(text for extra in extras for text in extra)]
    required = {re.split(r"[^\w-]", text)[0].lower() for text in texts}
    for path in (p for room in (*ROOMS, "sautereau") for p in (ROOT / room).rglob("*.py")):
        needed = {brought_by.get(name, name).lower() for name in imported(path)}
        assert needed <= required, path


@pytest.mark.parametrize(
    ("extra", "module", "use"),
    [
        (
            "live",
            "foxglove",
            "from sautereau.commands.live.foxglove import FoxgloveView\nFoxgloveView('press')",
        ),
        (
            "cluster",
            "distributed",
            "from sautereau.analysis.campaign.workers import run_over\n"
            "list(run_over(abs, [1], 'tcp://127.0.0.1:1'))",
        ),
    ],
)
def test_a_missing_extra_is_told_with_its_command(extra, module, use):
    program = (
        f"import sys\nsys.modules[{module!r}] = None\n"
        "from sautereau.rig.errors import SautereauError\n"
        "try:\n" + "".join(f"    {line}\n" for line in use.split("\n"))
        + "except SautereauError as error:\n    print(error)\n"
    )  # fmt: skip
    said = run(sys.executable, "-c", program, cwd=ROOT)
    assert f"pip install 'sautereau[{extra}]'" in said
    assert extra in PROJECT["optional-dependencies"]


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_an_empty_environment_presses_from_another_folder(built, tmp_path):
    home, elsewhere = tmp_path / "venv", tmp_path / "elsewhere"
    elsewhere.mkdir()
    run(sys.executable, "-m", "venv", home, cwd=elsewhere)
    python = home / ("Scripts" if sys.platform == "win32" else "bin") / "python"
    tool = python.with_name("sautereau")
    run(python, "-m", "pip", "install", "--quiet", built[0], cwd=elsewhere)
    run(python, "-m", "pip", "check", cwd=elsewhere)
    assert run(tool, "--version", cwd=elsewhere).strip() == PROJECT["version"]
    where = run(python, "-c", "import sautereau.rig; print(rig.__file__)", cwd=elsewhere)
    assert Path(where.strip()).is_relative_to(home)
    pressed = run(
        tool, "press", "--scene", "ideal", "-n", "1", "--out", "s", "--json", cwd=elsewhere
    )
    (press,) = json.loads(pressed)["presses"]
    assert press["release"] - press["contact"] == pytest.approx(0.02, abs=1e-4)
    words = ("--since", "60 ms", "--until", "70 ms")
    run(tool, "animate", "s/press-0001.mcap", "--out", "pluck.gif", *words, cwd=elsewhere)
    run(tool, "listen", "--out", "pluck.wav", "--duration", "100 ms", cwd=elsewhere)
    run(tool, "plan", "--plot", "plan.png", "--bench", "bench.svg", cwd=elsewhere)
    run(tool, "report", "s", "--out", "report.html", cwd=elsewhere)
    made = {path.name for path in elsewhere.iterdir()}
    assert {"pluck.gif", "pluck.wav", "plan.png", "bench.svg", "report.html"} <= made
