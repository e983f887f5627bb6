"""Rules of the repository that the linters do not check."""

import re
import tomllib
from pathlib import Path

import pytest

from benchmarks.imports import FRONTS, imported

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


@pytest.mark.parametrize("front", FRONTS, ids=lambda front: front.module)
def test_a_package_imports_only_what_it_needs(front):
    """So that commands start quickly."""
    _, brought = imported(front.module)
    assert brought <= set(front.brings)
