"""The house rules that a machine can check."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = ("rig", "trajectory", "daq", "analysis", "sim_backend", "robot", "commands")


def run(*words: str) -> subprocess.CompletedProcess:
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)


def test_arrows_between_rooms_go_down_only():
    done = run(str(Path(sys.executable).with_name("lint-imports")), "--no-cache")
    assert done.returncode == 0, done.stdout


def test_style():
    done = run(sys.executable, "-m", "ruff", "check", "--no-cache", ".")
    assert done.returncode == 0, done.stdout
    done = run(sys.executable, "-m", "ruff", "format", "--no-cache", "--check", ".")
    assert done.returncode == 0, done.stdout


def test_no_room_imports_the_front_door():
    for room in ROOMS:
        for path in (ROOT / room).rglob("*.py"):
            assert not re.search(r"(?m)^\s*(from|import) sautereau", path.read_text()), path


@pytest.mark.parametrize("room", ROOMS)
def test_rooms_are_typed(room):
    assert (ROOT / room / "py.typed").is_file()
