"""Maps in the user's cache folder, named by a hash of their inputs."""

import contextlib
import hashlib
import os
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.fe.table import (
    LOAD_LIMIT,
    MARGIN,
    STRAIN_LIMIT,
    DisplacementSeries,
)

VERSION = 1
"""Version of the stored maps; increase it when mesh, element, load or series change."""

_DAMAGED = (
    OSError, ValueError, TypeError, KeyError, IndexError, EOFError, RuntimeError, SyntaxError,
    MemoryError, struct.error, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""Errors that numpy and zipfile raise on a missing file or one with any wrong byte."""


def cache_folder() -> Path:
    """Return the folder of stored maps."""
    import platformdirs

    return platformdirs.user_cache_path("sautereau", appauthor=False) / "plectrum-fe"


def stored(inputs: list[Floats], make: Callable[[], DisplacementSeries]) -> DisplacementSeries:
    """Return the map of some inputs from the cache; build and store it if it is not there.

    A file that is damaged, or whose content does not match its name, is replaced.
    """
    key = _digest([np.array([VERSION, LOAD_LIMIT, STRAIN_LIMIT, MARGIN]), *inputs])
    path = cache_folder() / f"{key}.npz"
    table = _read(path, key)
    if table is None:
        table = make()
        with contextlib.suppress(OSError):  # without a cache only slower
            _write(path, key, table)
    return table


def _digest(arrays: list[Floats]) -> str:
    """Return a hash of the shapes and values of arrays."""
    content = hashlib.sha256()
    for array in arrays:
        content.update(f"{array.shape}".encode())
        content.update(np.ascontiguousarray(array, "<f8").tobytes())
    return content.hexdigest()


def _read(path: Path, key: str) -> DisplacementSeries | None:
    """Return a stored map; None if it is missing or damaged."""
    try:
        # Opened here because np.load does not close a file that is no archive.
        with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            coefficients, scales = file["coefficients"], file["scales"]
            seal = str(file["seal"])
    except _DAMAGED:
        return None
    if coefficients.ndim != 3 or scales.shape != (3,) or seal != _seal(key, coefficients, scales):
        return None
    return DisplacementSeries(coefficients, *scales.tolist())


def _write(path: Path, key: str, table: DisplacementSeries) -> None:
    """Store a map in one step, so that no other process reads an incomplete file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    scales = np.array([table.nearest, table.load, table.limit])
    seal = np.array(_seal(key, table.coefficients, scales))
    handle, name = tempfile.mkstemp(dir=path.parent, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, coefficients=table.coefficients, scales=scales, seal=seal)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _seal(key: str, coefficients: Floats, scales: Floats) -> str:
    """Return a hash that ties a map to its key."""
    return _digest([np.array([float(byte) for byte in bytes.fromhex(key)]), coefficients, scales])
