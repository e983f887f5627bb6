"""Reads a MATLAB or HDF5 file and writes its arrays of numbers as npz on standard output.

It runs as a separate program, because the compiled readers crash or block their process on some
damaged files. The first array holds, as JSON, the names of the others, their properties in the file
(unit; rate in Hz and start in s) and the document of an export by sautereau.

python array_reader.py mat|hdf5 FILE MOST_VALUES
"""

import io
import json
import sys
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

MOST_DEPTH = 20
"""Limit of structures within each other."""
UNIT_ATTRIBUTES = ("units", "unit")
DOCUMENT = "sautereau"

Found = tuple[dict[str, np.ndarray], dict[str, dict[str, str | float]], str | None]
"""Arrays; properties of each in the file: `unit`, `rate`, `start`; the document of an export."""


def main() -> None:
    """Read the file; a fault is one line on standard error, and status 1."""
    kind, path, most = sys.argv[1:]
    try:
        arrays, about, document = (read_mat if kind == "mat" else read_hdf5)(path, int(most))
    except Exception as error:  # noqa: BLE001 (the readers raise many kinds)
        sys.exit(f"{type(error).__name__}: {error}")
    file = io.BytesIO()
    np.savez(file, np.array(json.dumps([list(arrays), about, document])), *arrays.values())
    sys.stdout.buffer.write(file.getbuffer())


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
        return {name: _scaled(item) for name, item in datasets.items()}, about, text


def _about(item: Any) -> dict[str, str | float]:
    """Return unit, rate and start of a dataset, as far as the file gives them."""
    found: dict[str, str | float] = {}
    for key in UNIT_ATTRIBUTES:
        unit = item.attrs.get(key)
        unit = unit.decode() if isinstance(unit, bytes) else unit
        if isinstance(unit, str):
            found["unit"] = unit
    start = item.parent.get("starting_time")
    if start is not None and np.isfinite(rate := float(start.attrs.get("rate", np.nan))):
        found |= {"rate": rate, "start": float(start[()])}
    return found


def _scaled(item: Any) -> np.ndarray:
    """Return the values of a dataset, in its unit if the file says how."""
    scale, offset = (float(item.attrs.get(*one)) for one in (("conversion", 1), ("offset", 0)))
    return item[()] if (scale, offset) == (1, 0) else item[()] * scale + offset


def refuse(values: float, most: int) -> None:
    """Refuse a file that holds more values than the limit."""
    if values > most:
        raise ValueError(f"it holds {values:.0f} values, more than the limit MOST_VALUES = {most}")


if __name__ == "__main__":
    main()
