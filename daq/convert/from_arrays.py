"""Import of arrays: MATLAB's .mat, numpy's .npz and HDF5."""

import importlib.util
import io
import json
import subprocess
import sys
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sautereau.daq.convert import array_reader
from sautereau.daq.convert.document import Document, read_document, volts_name
from sautereau.daq.convert.formats import Columns, ImportSource, refuse_rows
from sautereau.daq.errors import RecordingError
from sautereau.rig.disk import open_regular

HDF5_AT = (0, 512)  # Bytes before the HDF5 signature; MATLAB writes 512 of its own
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
MOST_VALUES = 100_000_000  # Limit of the numbers in all arrays of a file, which are read together
MOST_COLUMNS = 64  # Limit of the columns of a matrix; a larger one is a picture and not a table
LONGEST = 120  # s, limit of the time in which a file is read

Array = np.ndarray[Any, Any]


def open_mat(path: Path) -> ImportSource:
    """Open a MATLAB file; the fields of a structure are called ``structure.field``.

    The elements of a cell, or of an array of structures, are called ``cell(1)``.
    Versions 4 to 7.2 are read by scipy; version 7.3 is HDF5.

    Raises:
        RecordingError: It is damaged, or not a MATLAB file.
    """
    with open_regular(path) as file:
        head = file.read(HDF5_AT[-1] + len(HDF5_SIGNATURE))
    if any(head[at:].startswith(HDF5_SIGNATURE) for at in HDF5_AT):
        return open_hdf5(path)
    return _source("MATLAB", *_read("mat", path)[:2])


def open_hdf5(path: Path) -> ImportSource:
    """Open an HDF5 file; a dataset is called ``group/dataset``, its attribute ``unit`` is its unit.

    ``conversion`` and ``offset``, and ``starting_time`` beside it with a ``rate``, are those of
    Neurodata Without Borders; ``scale_factor``, ``add_offset``, ``_FillValue`` and
    ``missing_value`` those of netCDF.

    Raises:
        RecordingError: h5py is not installed, or the file is damaged or not HDF5.
    """
    if importlib.util.find_spec("h5py") is None:
        raise RecordingError(
            "it is HDF5, which needs h5py; install it: pip install 'sautereau[hdf5]'"
        )
    arrays, about, text = _read("hdf5", path)
    document = None if text is None else read_document(text)
    if document is not None:
        raw = {volts_name(c.name): f"acquisition/{c.name}/data" for c in document.rig.daq.channels}
        arrays = {name: arrays[at] for name, at in raw.items() if at in arrays}
    return _source("HDF5", arrays, about, document)


def open_npz(path: Path) -> ImportSource:
    """Open a numpy archive; no object in it is unpickled.

    Raises:
        RecordingError: It is damaged, or not a numpy archive.
    """
    try:
        with open_regular(path) as file, zipfile.ZipFile(file) as archive:
            array_reader.refuse(sum(file.file_size for file in archive.infolist()) / 8, MOST_VALUES)
        with open_regular(path) as file, np.load(file, allow_pickle=False) as arrays:
            read = {name: arrays[name] for name in arrays.files}
            found = dict(array_reader.flat(read, "", array_reader.MOST_DEPTH))
    except Exception as error:  # numpy and zipfile raise many kinds, depending on the bytes
        raise RecordingError(
            f"it cannot be read as a numpy archive of numbers: {type(error).__name__}: {error}; use"
            " a copy, or save one vector for each channel"
        ) from error
    return _source("npz", found, {})


def _read(kind: str, path: Path) -> array_reader.Found:
    """Return the content of a file, read in a separate process."""
    command = [sys.executable, array_reader.__file__, kind, str(path), str(MOST_VALUES)]
    fault = "its reader has ended"
    try:
        run = subprocess.run(command, capture_output=True, check=True, timeout=LONGEST)
        with np.load(io.BytesIO(run.stdout), allow_pickle=False) as arrays:
            head, *found = (arrays[name] for name in arrays.files)
        names, about, document = json.loads(str(head))
        return dict(zip(names, found, strict=True)), about, document
    except subprocess.CalledProcessError as error:
        fault = error.stderr.decode(errors="replace").strip() or fault
    except subprocess.TimeoutExpired:
        fault = f"reading it takes longer than the limit LONGEST = {LONGEST} s"
    raise RecordingError(
        f"it cannot be read as a {kind} file: {fault}; use a copy, or save it again"
    )


def _source(
    kind: str,
    arrays: Mapping[str, Array],
    about: Mapping[str, Mapping[str, Any]],
    document: Document | None = None,
) -> ImportSource:
    """Return the columns of arrays: each vector, and of a matrix those along its longer axis."""
    columns: dict[str, Array] = {}
    given: dict[str, Mapping[str, Any]] = {}
    for name, array in arrays.items():
        table = np.squeeze(array)
        if array.dtype.kind not in "fiu" or not 1 <= table.ndim <= 2:
            continue
        if table.ndim == 1:
            found = {name: table}
        elif min(table.shape) <= MOST_COLUMNS:
            rows = table.T if table.shape[0] > table.shape[1] else table
            found = {f"{name}({i})": row for i, row in enumerate(rows, 1)}
        else:
            continue
        columns |= found
        given |= dict.fromkeys(found, about.get(name, {}))
    if document is None and not columns:
        raise RecordingError("it holds no vector of real numbers; save one for each channel")

    def read(names: list[str]) -> Columns:
        refuse_rows(max((len(columns[name]) for name in names), default=0))
        for name in names:
            if unknown := given[name].get("unknown"):
                raise RecordingError(
                    f"column {name!r} has {unknown}, whose meaning is unknown; write the final"
                    " values to a file without these"
                )
        return {name: columns[name].astype(np.float64) for name in names}

    def of(key: str) -> dict[str, Any]:
        return {name: said[key] for name, said in given.items() if key in said}

    return ImportSource(
        kind,
        tuple(columns),
        read,
        units=of("unit"),
        rates={name: rate for name, rate in of("rate").items() if rate > 0},
        starts=of("start"),
        document=document,
    )
