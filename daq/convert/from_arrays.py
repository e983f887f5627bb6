"""Import of arrays: MATLAB's .mat, numpy's .npz and HDF5."""

import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sautereau.daq.convert.formats import Columns, ImportSource, refuse_rows
from sautereau.daq.errors import RecordingError

HDF5_AT = (0, 512)
"""Bytes before the HDF5 signature; MATLAB writes 512 of its own."""
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
MOST_VALUES = 200_000_000
"""Limit of the numbers in all arrays of a compressed file, which are unpacked together."""
MOST_COLUMNS = 64
"""Limit of the columns of a matrix; a larger one is a picture and not a table."""
MOST_DEPTH = 20
"""Limit of structures or groups within each other."""
UNIT_ATTRIBUTES = ("unit", "units")

Array = np.ndarray[Any, Any]


def open_mat(path: Path) -> ImportSource:
    """Open a MATLAB file; the fields of a structure are called ``structure.field``.

    Versions 4 to 7.2 are read by scipy; version 7.3 is HDF5.

    Raises:
        RecordingError: It is damaged, or not a MATLAB file.
    """
    from scipy.io import loadmat, whosmat

    if _is_hdf5(path):
        return open_hdf5(path)
    try:
        _refuse_values(sum(int(np.prod(shape, dtype=float)) for _, shape, _ in whosmat(path)))
        variables = loadmat(path, simplify_cells=True)
    except RecordingError:
        raise
    except Exception as error:  # scipy raises many kinds, depending on the bytes
        raise RecordingError(
            f"it is damaged, or not a MATLAB file: {type(error).__name__}: {error}"
        ) from error
    found = {name: value for name, value in variables.items() if not name.startswith("__")}
    arrays = dict(_flat(found, ""))
    return _source("MATLAB", arrays, arrays.__getitem__)


def open_npz(path: Path) -> ImportSource:
    """Open a numpy archive; no object in it is unpickled.

    Raises:
        RecordingError: It is damaged, or not a numpy archive.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            _refuse_values(sum(member.file_size for member in archive.infolist()) // 8)
        with np.load(path, allow_pickle=False) as arrays:
            found = {name: arrays[name] for name in arrays.files}
    except RecordingError:
        raise
    except Exception as error:  # numpy and zipfile raise many kinds, depending on the bytes
        raise RecordingError(
            f"it is damaged, or not a numpy archive of numbers: {type(error).__name__}: {error}"
        ) from error
    return _source("npz", found, found.__getitem__)


def open_hdf5(path: Path) -> ImportSource:
    """Open an HDF5 file; a dataset is called ``group/dataset``, its attribute ``unit`` is its unit.

    Raises:
        RecordingError: h5py is not installed, or the file is damaged or not HDF5.
    """
    try:
        import h5py
    except ImportError as error:
        raise RecordingError(
            "it is HDF5, which needs h5py; install it: pip install 'sautereau[hdf5]'"
        ) from error

    shapes: dict[str, Array] = {}
    units: dict[str, str] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.shape and item.dtype.kind in "fiu":
            shapes[name] = np.broadcast_to(np.zeros((), item.dtype), item.shape)
            for key in UNIT_ATTRIBUTES:
                if isinstance(text := item.attrs.get(key), str | bytes):
                    units[name] = text.decode() if isinstance(text, bytes) else text

    def load(name: str) -> Array:
        with h5py.File(path) as file:
            return np.asarray(file[name])

    try:
        with h5py.File(path) as file:
            file.visititems(visit)
    except Exception as error:  # h5py raises many kinds, depending on the bytes
        raise RecordingError(
            f"it is damaged, or not an HDF5 file: {type(error).__name__}: {error}"
        ) from error
    return _source("HDF5", shapes, load, units)


def _is_hdf5(path: Path) -> bool:
    with path.open("rb") as file:
        head = file.read(HDF5_AT[-1] + len(HDF5_SIGNATURE))
    return any(head[at:].startswith(HDF5_SIGNATURE) for at in HDF5_AT)


def _refuse_values(count: int) -> None:
    if count > MOST_VALUES:
        raise RecordingError(
            f"it holds {count} values, more than the limit MOST_VALUES = {MOST_VALUES}; save single"
            " presses"
        )


def _flat(values: Mapping[str, Any], prefix: str, depth: int = 0) -> Iterator[tuple[str, Array]]:
    """Yield the arrays in nested structures, by their paths with dots."""
    for name, value in values.items():
        if isinstance(value, Mapping) and depth < MOST_DEPTH:
            yield from _flat(value, f"{prefix}{name}.", depth + 1)
        elif isinstance(value, np.ndarray):
            yield prefix + name, value


def _source(
    kind: str,
    arrays: Mapping[str, Array],
    load: Callable[[str], Array],
    units: Mapping[str, str] | None = None,
) -> ImportSource:
    """Return the columns of arrays: each vector, and of a matrix those along its longer axis.

    Args:
        kind: Name of the format.
        arrays: By name; only their shapes and types are used.
        load: Returns the values of a named array.
        units: By the names of the arrays.
    """
    columns: dict[str, tuple[str, int]] = {}
    for name, array in arrays.items():
        shape = [n for n in array.shape if n != 1]
        if array.dtype.kind not in "fiu" or not shape or len(shape) > 2:
            continue
        if len(shape) == 1:
            columns[name] = (name, 0)
        elif min(shape) <= MOST_COLUMNS:
            columns |= {f"{name}({i + 1})": (name, i) for i in range(min(shape))}
    if not columns:
        raise RecordingError("it holds no vector of real numbers; save one for each channel")

    def read(names: list[str]) -> Columns:
        return {name: column(*columns[name]) for name in names}

    def column(name: str, index: int) -> np.ndarray:
        refuse_rows(max(arrays[name].shape))
        try:
            array = np.squeeze(load(name))
        except Exception as error:  # a damaged chunk; the kind depends on the bytes
            raise RecordingError(
                f"its array {name!r} cannot be read: {type(error).__name__}: {error}; use a copy"
            ) from error
        rows = array if array.ndim == 1 else array.T if array.shape[0] > array.shape[1] else array
        return np.asarray(rows if rows.ndim == 1 else rows[index], dtype=np.float64)

    given = units or {}
    return ImportSource(
        kind,
        tuple(columns),
        read,
        units={name: given[array] for name, (array, _) in columns.items() if array in given},
    )
