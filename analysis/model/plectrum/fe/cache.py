"""The map of one shape of plectrum: Chebyshev series of displacement and rotation.

Maps are stored in the user's cache folder, named by a hash of their inputs.
"""

import contextlib
import hashlib
import io
import struct
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path

import numpy as np

from sautereau.analysis.model.plectrum.base import Floats
from sautereau.rig.disk import open_regular, write_durably

LOAD_LIMIT = 2.0
"""Largest load f = F L^2 / EI of a map, dimensionless; EI follows from the plectrum's rotation
under a small load at its tip. A uniform plectrum turns by 56 degrees at this load."""
STRAIN_LIMIT = 0.2
"""Largest strain of the edges at the clamp, which limits the load of thick plectra."""
MARGIN = 1.02
"""Ratio of the tabulated to the accepted load, for differences taken across the limit."""
VERSION = 3
"""Version of the stored maps; increase it when mesh, element, load or series change."""

_DAMAGED = (
    OSError, ValueError, TypeError, KeyError, IndexError, EOFError, RuntimeError, SyntaxError,
    MemoryError, struct.error, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""Errors that numpy and zipfile raise on a missing file or one with any wrong byte."""


@dataclass(frozen=True)
class DisplacementSeries:
    """Series in s, f and T of x, z and rotation, in lengths and rad, each divided by f.

    f and T are the load along the normal of the section under the string, and the one along its
    tangent towards the tip over it.
    """

    coefficients: Floats
    """Dimensionless, shape (3, drags, positions, loads)."""
    nearest: float
    """Smallest s, in lengths."""
    least: float
    """Smallest T."""
    most: float
    """Largest T."""
    load: float
    """Force at f = 1, in E W L."""
    limit: float
    """Largest f, dimensionless."""
    error: float
    """Largest error between the nodes, relative to displacement and rotation."""

    def values(self, s: Floats, f: Floats, drag: Floats) -> Floats:
        """Return the series, their slopes along s, along f and along T; shape (4, 3, *s.shape)."""
        chebyshev, shape = np.polynomial.chebyshev, s.shape
        terms = self.coefficients.shape[1:]
        wide = self.most - self.least
        pulled = chebyshev.chebvander(
            (2 * drag.ravel() - self.least - self.most) / (wide or 1.0), terms[0] - 1
        )
        along = chebyshev.chebvander(
            2 * (s.ravel() - self.nearest) / (1 - self.nearest) - 1, terms[1] - 1
        )
        across = chebyshev.chebvander(2 * f.ravel() / (self.limit * MARGIN) - 1, terms[2] - 1)
        found = np.einsum("ijdpl,nl->ijdpn", self._series, across, optimize=True)
        found = np.einsum("ijdpn,np->ijdn", found, along, optimize=True)
        return np.einsum("ijdn,nd->ijn", found, pulled).reshape(4, 3, *shape)

    @cached_property
    def _series(self) -> Floats:
        """The series and their slopes along s, f and T, shape (4, *coefficients.shape)."""
        series = np.zeros((4, *self.coefficients.shape))
        series[0] = self.coefficients
        reaches = (1 - self.nearest, self.limit * MARGIN, self.most - self.least or 1.0)
        for number, (axis, reach) in enumerate(zip((2, 3, 1), reaches, strict=True), 1):
            slope = np.polynomial.chebyshev.chebder(self.coefficients, scl=2 / reach, axis=axis)
            series[number][tuple(slice(size) for size in slope.shape)] = slope
        return series


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
        with open_regular(path) as raw, np.load(raw, allow_pickle=False) as file:
            coefficients, scales = file["coefficients"], file["scales"]
            seal = str(file["seal"])
    except _DAMAGED:
        return None
    if coefficients.ndim != 4 or scales.shape != (6,) or seal != _seal(key, coefficients, scales):
        return None
    return DisplacementSeries(coefficients, *scales.tolist())


def _write(path: Path, key: str, table: DisplacementSeries) -> None:
    """Store a map in one step, so that no other process reads an incomplete file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    scales = np.array([getattr(table, field.name) for field in fields(table)[1:]])
    seal = np.array(_seal(key, table.coefficients, scales))
    file = io.BytesIO()
    np.savez(file, coefficients=table.coefficients, scales=scales, seal=seal)
    write_durably(path, file.getvalue(), replace=True)


def _seal(key: str, coefficients: Floats, scales: Floats) -> str:
    """Return a hash that ties a map to its key."""
    return _digest([np.array([float(byte) for byte in bytes.fromhex(key)]), coefficients, scales])
