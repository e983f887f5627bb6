"""Rules of the repository that the linters do not check."""

import re
import subprocess
import sys
import tomllib
from itertools import pairwise
from pathlib import Path

import pytest

from benchmarks.imports import FRONTS, HEAVY

ROOT = Path(__file__).parents[1]
FOLDERS = ("rig", "trajectory", "daq", "analysis", "sim_backend", "robot", "sautereau")


def test_every_folder_is_packaged():
    """A folder that is missing from pyproject.toml would be missing from the wheel."""
    listed = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    found = {
        ".".join(path.parent.relative_to(ROOT).parts)
        for folder in FOLDERS
        for path in (ROOT / folder).rglob("__init__.py")
    }
    prefixed = {name if name.startswith("sautereau") else f"sautereau.{name}" for name in found}
    assert set(listed["packages"]) == prefixed


@pytest.mark.parametrize("folder", FOLDERS)
def test_packages_are_imported_by_their_full_name(folder):
    bare = rf"(?m)^\s*(?:from|import) (?:{'|'.join(FOLDERS[:-1])})\b"
    for path in (ROOT / folder).rglob("*.py"):
        assert not re.search(bare, path.read_text(encoding="utf-8")), path


@pytest.mark.parametrize("folder", FOLDERS)
def test_packages_are_typed(folder):
    assert (ROOT / folder / "py.typed").is_file()


IMPORTS = """
import importlib, sys
for module in sys.argv[1].split():
    importlib.import_module(module)
    print(module, *(name for name in sys.argv[2].split() if name in sys.modules))
"""


def test_a_package_imports_only_what_it_needs():
    """So that commands start quickly; in one process, first what may bring the least."""
    allowed = {front.module: set(front.brings) for front in FRONTS}
    modules = sorted(allowed, key=lambda module: len(allowed[module]))
    assert all(allowed[one] <= allowed[more] for one, more in pairwise(modules))
    command = [sys.executable, "-c", IMPORTS, " ".join(modules), " ".join(HEAVY)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    for module, *brought in map(str.split, done.stdout.splitlines()):
        assert set(brought) <= allowed[module], module
