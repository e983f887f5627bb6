"""Import formats: a registry by file extension, and what each of them returns of a file.

A format is a function that takes a path and returns an `ImportSource`.
docs/add-an-import-format.md shows how another package adds one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sautereau.daq.convert.document import Document
from sautereau.daq.errors import RecordingError
from sautereau.rig.registry import Registry

FORMATS = Registry(
    "sautereau.import_formats",
    "import format",
    {
        "tdms": "sautereau.daq.convert.from_tdms:open_tdms",
        "csv": "sautereau.daq.convert.from_csv:open_csv",
        "wav": "sautereau.daq.convert.from_wav:open_wav",
        "parquet": "sautereau.daq.convert.from_parquet:open_parquet",
    },
    RecordingError,
)
"""Functions that open a file, by file extension in lower case, without the dot."""

SIMULATED = "simulated"
"""Column that an export of a simulated recording has, so that the table alone shows it."""

Columns = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class ImportSource:
    """An open file of another program; None or an empty mapping: not given in the file."""

    kind: str
    """Name of the format, for messages."""
    names: tuple[str, ...]
    """Names of the columns."""
    read: Callable[[list[str]], Columns]
    """Returns the named columns, each an array of float64 of shape (n_samples,)."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Unit of the values, by column: `V`, `mm/s`."""
    rates: Mapping[str, float] = field(default_factory=dict)
    """Sampling rate in Hz, by column."""
    starts: Mapping[str, float] = field(default_factory=dict)
    """Time of the first sample in s on the file's own time axis, by column."""
    started: str | None = None
    """Date of time 0 of that axis, ISO 8601 with the time zone."""
    full_scale: bool = False
    """Whether the values are fractions of a full scale that the file does not give."""
    document: Document | None = None
    """Metadata of an export by sautereau; then nothing else is needed."""


def extensions() -> str:
    """Return the file extensions of all registered formats, for help and messages."""
    return ", ".join(f".{name}" for name in FORMATS.names())


def open_source(path: Path) -> ImportSource:
    """Open a file in the format that is registered for its file extension.

    Raises:
        RecordingError: The file does not exist, has an unknown extension, or is damaged.
    """
    if not path.is_file():
        raise RecordingError("no such file; check its name and folder")
    extension = path.suffix.lower().removeprefix(".")
    if extension not in FORMATS.names():
        raise RecordingError(
            f"no import format is registered for the file extension {path.suffix!r}; convert the"
            f" file to one of {extensions()}, or add a format as docs/add-an-import-format.md shows"
        )
    return FORMATS.get(extension)(path)


def refuse_missing(name: str, missing: NDArray[np.bool_]) -> None:
    """Refuse a column with missing values.

    Args:
        name: Name of the column.
        missing: Which rows have no value, shape (n_rows,).

    Raises:
        RecordingError: Gives the number of such rows and the first of them, counted from 1.
    """
    rows = np.flatnonzero(missing)
    if len(rows):
        raise RecordingError(
            f"column {name!r} has no number in {len(rows)} row{'s' * (len(rows) > 1)}, the first is"
            f" row {rows[0] + 1}; gaps are never filled: cut the file before it"
        )
