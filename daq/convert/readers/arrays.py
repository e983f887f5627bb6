"""Arrays of numbers in MATLAB, HDF5, numpy and sound files."""

import math
import zipfile
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from sautereau.daq.convert.readers import Found, refuse, refuse_cut

MOST_DEPTH = 20  # Limit of structures within each other
UNIT_ATTRIBUTES = ("units", "unit")
SCALED = (("conversion", "offset"), ("scale_factor", "add_offset"))
"""Attributes of Neurodata Without Borders and of netCDF (CF): a value is data * the first + the
second."""
MISSING = ("_FillValue", "missing_value")  # Attributes of netCDF with the data of a missing value
UNKNOWN = (
    "_unsigned",
    "valid_min",
    "valid_max",
    "valid_range",
    "scale",
    "scaling",
    "gain",
    "factor",
    "slope",
    "intercept",
    "calibration",
    "sensitivity",
)
"""Attributes, in lower case, that say that the values are others than the data."""
BESIDE = ("channel_conversion",)  # The same as datasets beside the data
DOCUMENT = "sautereau"


def read_mat(path: str, most: int) -> Found:
    """Return the arrays of a MATLAB file of versions 4 to 7.2."""
    from scipy.io import loadmat, whosmat

    refuse(sum(float(np.prod(shape, dtype=float)) for _, shape, _ in whosmat(path)), most)
    variables = loadmat(path, simplify_cells=True)
    named = {name: value for name, value in variables.items() if not name.startswith("__")}
    return dict(flat(named, "", MOST_DEPTH)), {}, None


def flat(values: Mapping[str, Any], prefix: str, depth: int) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the arrays of numbers in nested structures, by their paths with dots.

    Elements of arrays of structures and of cells are counted from 1: ``channels(2).data``.
    """
    for name, value in values.items():
        array = isinstance(value, np.ndarray)
        if array and value.dtype.kind in "fiu":
            yield prefix + name, value
        elif not depth:
            continue
        elif isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{name}.", depth - 1)
        elif array and value.dtype.names:
            fields = {field: value[field] for field in value.dtype.names}
            yield from flat(fields, f"{prefix}{name}.", depth - 1)
        elif isinstance(value, list) or (array and value.dtype.kind == "O"):
            elements = value if isinstance(value, list) else value.ravel(order="F")
            counted = {f"{name}({i})": element for i, element in enumerate(elements, 1)}
            yield from flat(counted, prefix, depth - 1)


def read_numpy(path: str, most: int) -> Found:
    """Return the arrays of an .npz file, or the one of an .npy file; no object is unpickled."""
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            refuse(sum(file.file_size for file in archive.infolist()) / 8, most)
    loaded = np.load(path, allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return dict(flat({"data": loaded}, "", MOST_DEPTH)), {}, None
    with loaded as arrays:
        return dict(flat({name: arrays[name] for name in arrays.files}, "", MOST_DEPTH)), {}, None


def read_hdf5(path: str, most: int) -> Found:
    """Return the datasets of an HDF5 file, by their paths.

    Where they are laid out as in Neurodata Without Borders, they are scaled.
    """
    import h5py

    datasets: dict[str, Any] = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.shape and item.dtype.kind in "fiu":
            datasets[name] = item

    with h5py.File(path) as file:
        file.visititems(visit)
        refuse(sum(float(item.size) for item in datasets.values()), most)
        document = file.get(DOCUMENT)
        text = str(document.asstr()[()]) if isinstance(document, h5py.Dataset) else None
        about = {name: _about(item) for name, item in datasets.items()}
        values = {
            n: item[()] if "unknown" in about[n] else _scaled(item) for n, item in datasets.items()
        }
        return values, about, text


def _about(item: Any) -> dict[str, str | float]:
    """Return unit, rate and start of a dataset, as far as the file gives them."""
    found: dict[str, str | float] = {}
    for key in UNIT_ATTRIBUTES:
        unit = item.attrs.get(key)
        unit = unit.decode() if isinstance(unit, bytes) else unit
        if isinstance(unit, str):
            found["unit"] = unit
    if unknown := _unknown(item):
        found["unknown"] = unknown
    start = item.parent.get("starting_time")
    if start is not None and np.isfinite(rate := float(start.attrs.get("rate", np.nan))):
        found |= {"rate": rate, "start": float(start[()])}
    return found


def _scaled(item: Any) -> np.ndarray:
    """Return the values of a dataset, in its unit if the file says how; NaN where it has none."""
    values, missing = item[()], np.zeros(item.shape, dtype=bool)
    for key in MISSING:
        if key in item.attrs:
            missing |= np.isin(values, item.attrs[key])
    for scale, offset in SCALED:
        if scale in item.attrs or offset in item.attrs:
            given = ((scale, 1), (offset, 0))
            factor, zero = (np.asarray(item.attrs.get(*one), float).item() for one in given)
            values = values if (factor, zero) == (1, 0) else values * factor + zero
    return np.where(missing, np.nan, values) if missing.any() else values


def _unknown(item: Any) -> str:
    """Return what may change the meaning of a dataset's values in an unknown way."""
    names = {key for key in item.attrs if key.lower() in UNKNOWN}
    pairs = [[key for key in pair if key in item.attrs] for pair in SCALED]
    names |= {key for pair in pairs for key in pair if all(pairs)}
    names |= {key for key in BESIDE if key in item.parent}
    for key in (*MISSING, *(key for pair in SCALED for key in pair)):
        value = np.asarray(item.attrs.get(key, 0))
        if value.dtype.kind not in "fiu" or (value.size > 1 and key not in MISSING):
            names.add(key)
    written = item.id.get_storage_size() > 0
    if item.chunks:
        blocks = math.prod(-(-n // m) for n, m in zip(item.shape, item.chunks, strict=True))
        written = item.id.get_num_chunks() == blocks
    if item.size and not written:
        names.add("blocks that were never written")
    return ", ".join(sorted(names))


def read_sound(path: str, most: int) -> Found:
    """Return the channels of a sound file that scipy does not read (FLAC, Wave64, AIFF, CAF).

    They are called 1, 2 and so on, in fractions of full scale.
    """
    import soundfile

    with soundfile.SoundFile(path) as file:
        refuse(file.frames * file.channels, most)
        samples = file.read(dtype="float64", always_2d=True)
        refuse_cut("each channel", len(samples), file.frames)
        arrays = {str(n): column for n, column in enumerate(samples.T, 1)}
        return arrays, {name: {"rate": float(file.samplerate)} for name in arrays}, None
