"""Maps kept in the user's cache, each under the content of what it was built from."""

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
from sautereau.analysis.model.plectrum.fe.table import LOAD_LIMIT, MARGIN, STRAIN_LIMIT, Table

VERSION = 1
"""Of what is stored; raise it with any change of mesh, element, load or series."""

_DAMAGED = (
    OSError, ValueError, TypeError, KeyError, IndexError, EOFError, RuntimeError, SyntaxError,
    MemoryError, struct.error, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""What numpy and zipfile raise on files of which any byte may be wrong, or where none is."""


def cache_folder() -> Path:
    """Return the folder of stored maps."""
    import platformdirs

    return platformdirs.user_cache_path("sautereau", appauthor=False) / "plectrum-fe"


def stored(inputs: list[Floats], make: Callable[[], Table]) -> Table:
    """Return the map of some inputs, from the cache or else made and put there.

    A file that is damaged, or is not what its name says, is made anew.
    """
    key = _digest([np.array([VERSION, LOAD_LIMIT, STRAIN_LIMIT, MARGIN]), *inputs])
    path = cache_folder() / f"{key}.npz"
    table = _read(path, key)
    if table is None:
        table = make()
        with contextlib.suppress(OSError):  # without a cache it is only slower
            _write(path, key, table)
    return table


def _digest(arrays: list[Floats]) -> str:
    """Return a hash of the shapes and values of arrays."""
    content = hashlib.sha256()
    for array in arrays:
        content.update(f"{array.shape}".encode())
        content.update(np.ascontiguousarray(array, "<f8").tobytes())
    return content.hexdigest()


def _read(path: Path, key: str) -> Table | None:
    """Return a stored map, or None where there is none that is whole."""
    try:
        # Opened here because np.load forgets to close what is no archive.
        with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
            coefficients, scales = file["coefficients"], file["scales"]
            seal = str(file["seal"])
    except _DAMAGED:
        return None
    if coefficients.ndim != 3 or scales.shape != (3,) or seal != _seal(key, coefficients, scales):
        return None
    return Table(coefficients, *scales.tolist())


def _write(path: Path, key: str, table: Table) -> None:
    """Store a map so that no other process ever sees half of it."""
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
