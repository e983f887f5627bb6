"""The level `fe` of the plectrum: any outline by finite elements, from a stored table."""

import contextlib
import hashlib
import io
import struct
import zipfile
import zlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np

from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.cantilever import FRICTION_MAX
from sautereau.analysis.model.plectrum.elastica import Elastica, nearest_of
from sautereau.analysis.model.plectrum.fe.solve import Elastic
from sautereau.analysis.model.plectrum.profile import Profile
from sautereau.analysis.model.plectrum.table import Samples, Table
from sautereau.rig.disk import open_regular, write_durably
from sautereau.rig.instrument import Plectrum

VERSION = 5  # Version of the stored maps; increase it when mesh, element, load or table change

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


def elastic_of(plectrum: Plectrum) -> Elastic:
    """Return the material of a plectrum, whose age leaves the ratios of the moduli."""
    along, shear = plectrum.youngs_modulus, plectrum.shear_modulus
    across = (plectrum.transverse_modulus or along) / along
    return Elastic(plectrum.poisson_ratio, across, shear and shear / along)


class FE(Elastica):
    """A plectrum of any outline, plane stress, with large rotations.

    The angle is the mean rotation of the section plus the slope of the unloaded upper edge. The
    load is normal to the deformed upper edge; friction acts there too, and bends the plectrum
    slightly more than on the mid-line.
    """

    represents = (*Elastica.represents, "transverse_modulus", "shear_modulus")

    def _table_of(self, plectrum: Plectrum, profile: Profile) -> Table:
        """Read the table from the cache, or build it.

        Raises:
            ModelError: The overlap is out of range, or the elements find no equilibrium.
        """
        return _table(profile, elastic_of(plectrum), nearest_of(plectrum))


@lru_cache(maxsize=32)
def _table(profile: Profile, material: Elastic, nearest: float) -> Table:
    def make():
        # Imported here because it imports scikit-fem, which a stored table does not need.
        from sautereau.analysis.model.plectrum.fe.build import build

        return build(profile, material, nearest)[0]

    ratios = [material.poisson_ratio, FRICTION_MAX, nearest]
    if material[1:] != Elastic(0.0)[1:]:
        ratios += [material.across, material.shear or 0.0]
    ratios = np.array(ratios)
    return stored([profile.x, profile.top, profile.bottom, ratios], make).table()
