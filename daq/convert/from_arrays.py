"""Import of files that a library reads: arrays, instruments' files, sound and workbooks.

Each library runs in a program of its own, see `sautereau.daq.convert.readers`.
"""

import importlib.util
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import weakref
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp
from typing import Any

import numpy as np

from sautereau.daq.convert.document import Document, read_document, volts_name
from sautereau.daq.convert.formats import Columns, ImportSource, refuse_rows
from sautereau.daq.convert.from_tables import open_csv
from sautereau.daq.convert.readers import MOST_COLUMNS, Found
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.provenance import PROFILE
from sautereau.rig.disk import new_file, open_regular
from sautereau.rig.errors import require

READERS = "sautereau.daq.convert.readers"  # Program that reads a file
HDF5_AT = (0, 512)  # Bytes before the HDF5 signature; MATLAB writes 512 of its own
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
MOST_VALUES = 100_000_000  # Limit of the numbers in all arrays of a file, which are read together
LONGEST = 120  # s, limit of the processor time in which a file is read
HANGING = 20 * LONGEST  # s of real time, for a busy machine, and a disk that does not answer

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
    return _opened(path, "MATLAB")


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
    arrays, about, text = _read("HDF5", path)
    document = None if text is None else read_document(text)
    if document is not None:
        raw = {volts_name(c.name): f"acquisition/{c.name}/data" for c in document.rig.daq.channels}
        arrays = {name: arrays[at] for name, at in raw.items() if at in arrays}
    return _source("HDF5", arrays, about, document)


def open_xlsx(path: Path) -> ImportSource:
    """Open a workbook: its active sheet, which is interpreted as a text table is.

    Raises:
        RecordingError: It is damaged, or its sheet has no rows of numbers.
        MissingExtraError: openpyxl is not installed.
    """
    require("formats", f"{path}: workbook", "openpyxl")
    arrays, about, _ = _read("workbook", path)
    folder = Path(mkdtemp(prefix="sautereau-"))
    table = folder / "sheet.tsv"
    with new_file(table) as file:
        file.write(arrays["rows"].tobytes())
    try:
        found = open_csv(table, ".")
    except RecordingError:
        shutil.rmtree(folder)
        raise

    def read(names: list[str]) -> Columns:
        return found.read(names)

    weakref.finalize(read, shutil.rmtree, folder, ignore_errors=True)  # with the source
    guess = f"{about['rows']['unit']}, {found.guess}"
    return replace(found, kind="workbook", read=read, guess=guess)


def _opened(
    path: Path, kind: str, what: str = "", extra: str = "", library: str = ""
) -> ImportSource:
    """Open a file, which may need a library of an extra.

    Raises:
        RecordingError: It is damaged or cut off, or no file of this kind.
        MissingExtraError: The library is not installed.
    """
    if library:
        require(extra, f"{path}: {what}", library)
    return replace(_source(kind, *_read(kind, path)[:2]), full_scale=kind == "sound")


open_numpy = partial(_opened, kind="numpy")
"""A numpy array or archive; no object in it is unpickled."""
open_lvm = partial(
    _opened, kind="lvm", what="LabVIEW measurement file", extra="formats", library="lvm_read"
)
"""A LabVIEW measurement file; the channels of several segments have their numbers."""
open_uff = partial(
    _opened, kind="universal", what="universal file", extra="formats", library="pyuff"
)
"""A universal file; its columns are the functions of time, called by node and direction."""
open_sound = partial(_opened, kind="sound", what="sound file", extra="formats", library="soundfile")
"""A sound file other than WAV; as there, its values are fractions of full scale."""
open_mdf = partial(_opened, kind="MDF", what="MDF", extra="mdf", library="asammdf")
"""ASAM's measurement data format; the channels of several groups have their numbers."""


def open_rosbag(path: Path) -> ImportSource:
    """Open a bag of ROS; its columns are the numbers in the messages of each topic.

    Raises:
        RecordingError: It is one of sautereau's own recordings, or as `_opened`.
    """
    with open_regular(path) as file:
        own = PROFILE.encode() in file.read(64)  # In the header that every MCAP file begins with
    if own:
        raise RecordingError("it is a recording already: all commands take it as it is")
    return _opened(path, kind="ROS bag", what="ROS bag", extra="ros", library="rosbags")


def _read(kind: str, path: Path) -> Found:
    """Return the content of a file, read by a program of its own with limited memory and time."""
    with open_regular(path):  # no device, and no pipe
        pass
    limits = str(MOST_VALUES), str(LONGEST)
    command = [sys.executable, "-P", "-m", READERS, kind, str(path), *limits]
    fault, slow = "its reader has ended", "reading it takes longer than the limit"
    try:
        with TemporaryDirectory(prefix="sautereau-") as folder:  # asammdf leaves files in it
            env = os.environ | dict.fromkeys(("TMPDIR", "TEMP", "TMP"), folder)
            run = subprocess.run(command, capture_output=True, check=True, timeout=HANGING, env=env)
        with np.load(io.BytesIO(run.stdout), allow_pickle=False) as arrays:
            head, *found = (arrays[name] for name in arrays.files)
        names, about, document = json.loads(str(head))
        return dict(zip(names, found, strict=True)), about, document
    except subprocess.CalledProcessError as error:
        *_, fault = [fault, *error.stderr.decode(errors="replace").strip().splitlines()]
        if -error.returncode == getattr(signal, "SIGXCPU", None):
            fault = f"{slow} LONGEST = {LONGEST} s of processor time"
    except subprocess.TimeoutExpired:
        fault = f"{slow} HANGING = {HANGING} s"
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
        dates=of("date"),
        document=document,
    )
