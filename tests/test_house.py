"""Rules of the repository that the linters do not check."""

import ast
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
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


OTHER_WAYS = {
    "rig/disk.py": "the one way",
    "rig/version.py": "the code of the package, for its hash",
    "trajectory/urdf.py": "a template of the package",
    "daq/file/schemas.py": "schemas of the package",
    "daq/file/container/durable.py": "a recording keeps the name NAME.part while it is written",
    "analysis/report/build.py": "styles and scripts of the package",
    "sim_backend/devices/galil/reference.py": "a table of the package",
    "sim_backend/physics/exact/compile.py": "modules of the package",
    "robot/drivers/galil/dmc.py": "the controller's program, of the package",
    "sautereau/doctor.py": "measures the speed of a disk with a file that has no name",
    "sautereau/commands/app.py": "the terminal, and the device that drops everything",
    "sautereau/entrance/package.py": "files inside an archive that `rig.disk` writes",
    "sautereau/commands/output.py": "the device that drops everything",
    "sim_backend/devices/daqmx/progress.py": "the log that a client of the card asks for",
}
"""Files of the package that open files in another way than `rig.disk`, and why."""
_READS = {"read_text", "read_bytes", "write_text", "write_bytes", "touch", "rename", "link_to"}
_OPENS = {"open", "TemporaryFile", "NamedTemporaryFile", "mkstemp", "FileHandler", "fdopen"}


def _other_ways(tree: ast.AST) -> Iterator[int]:
    """Yield the lines with calls that read or write a file that is named by a path."""
    own = {
        name.asname or name.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("sautereau")
        for name in node.names
    }
    own |= {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        function, arguments = node.func, [*node.args, *(word.value for word in node.keywords)]
        name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
        if isinstance(function, ast.Name) and name in own:
            continue
        modes = {a.value for a in arguments if isinstance(a, ast.Constant)}
        is_path = isinstance(function, ast.Attribute) and name == "open"
        is_path &= bool(modes & _MODES or {"encoding"} & {word.arg for word in node.keywords})
        if name in _READS or is_path or (name in _OPENS and _of_system(function)):
            yield node.lineno
        if name == "savefig" and "format" not in {word.arg for word in node.keywords}:
            yield node.lineno  # to a path: a stream has no extension


_MODES = {"r", "rb", "w", "wb", "x", "xb", "a", "ab", "r+b", "w+b", "x+b"}


def _of_system(function: ast.expr) -> bool:
    """Return whether a function is Python's `open`, or of os, tempfile or logging."""
    if isinstance(function, ast.Name):
        return function.id in _OPENS
    value = function.value if isinstance(function, ast.Attribute) else None
    return isinstance(value, ast.Name) and value.id in ("os", "tempfile", "logging", "io")


def test_files_are_read_and_written_in_one_way():
    """A reader without limits, or a writer that follows links, would be a way around it."""
    called = re.compile(rf"\b(?:{'|'.join((*_READS, *_OPENS, 'savefig'))})\(")
    found = {
        path.relative_to(ROOT).as_posix(): sorted(lines)
        for folder in FOLDERS
        for path in sorted((ROOT / folder).rglob("*.py"))
        if called.search(text := path.read_text(encoding="utf-8"))
        and (lines := set(_other_ways(ast.parse(text))))
    }
    assert {name: lines for name, lines in found.items() if name not in OTHER_WAYS} == {}
    assert sorted(set(OTHER_WAYS) - set(found)) == []
