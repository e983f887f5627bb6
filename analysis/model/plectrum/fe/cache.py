"""The tables of finite elements in the user's cache folder, named by a hash of their inputs."""

import contextlib
import hashlib
import io
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.table import Samples
from sautereau.rig.disk import open_regular, write_durably

VERSION = 4  # Version of the stored maps; increase it when mesh, element, load or table change

_ARRAYS = ("laws", "line", "scales")

_DAMAGED = (
    OSError, ValueError, TypeError, KeyError, IndexError, EOFError, RuntimeError, SyntaxError,
    MemoryError, struct.error, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""Errors that numpy and zipfile raise on a missing file or one with any wrong byte."""


def cache_folder() -> Path:
    """Return the folder of stored maps."""
    import platformdirs

    return platformdirs.user_cache_path("sautereau", appauthor=False) / "plectrum-fe"


def stored(inputs: list[Floats], make: Callable[[], Samples]) -> Samples:
    """Return the table of some inputs from the cache; build and store it if it is not there.

    A file that is damaged, or whose content does not match its name, is replaced.
    """
    key = _digest([np.array([float(VERSION)]), *inputs])
    path = cache_folder() / f"{key}.npz"
    found = _read(path, key)
    if found is None:
        found = make()
        with contextlib.suppress(OSError):  # without a cache only slower
            _write(path, key, found)
    return found


def _digest(arrays: list[Floats]) -> str:
    """Return a hash of the shapes and values of arrays."""
    content = hashlib.sha256()
    for array in arrays:
        content.update(f"{array.shape}".encode())
        content.update(np.ascontiguousarray(array, "<f8").tobytes())
    return content.hexdigest()


def _read(path: Path, key: str) -> Samples | None:
    """Return a stored table; None if it is missing or damaged."""
    try:
        # Opened here because np.load does not close a file that is no archive.
        with open_regular(path) as raw, np.load(raw, allow_pickle=False) as file:
            arrays = [file[name] for name in _ARRAYS]
            seal = str(file["seal"])
    except _DAMAGED:
        return None
    if seal != _seal(key, arrays):
        return None
    laws, line, scales = arrays
    cells, *others = scales.tolist()
    return Samples(laws, line, int(cells), *others)


def _write(path: Path, key: str, found: Samples) -> None:
    """Store a table in one step, so that no other process reads an incomplete file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    scales = np.array([found.cells, found.q_max, found.nearest, found.error])
    arrays = [found.laws, found.line, scales]
    file = io.BytesIO()
    named = dict(zip(_ARRAYS, arrays, strict=True))
    np.savez(file, **named, seal=np.array(_seal(key, arrays)))
    write_durably(path, file.getvalue(), replace=True)


def _seal(key: str, arrays: list[Floats]) -> str:
    """Return a hash that ties a table to its key."""
    return _digest([np.array([float(byte) for byte in bytes.fromhex(key)]), *arrays])
