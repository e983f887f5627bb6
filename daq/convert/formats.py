"""Import formats: a registry by file extension, and what each format returns for a file.

A format is a function that takes a path and returns an `ImportSource`.
docs/add-an-import-format.md shows how another package adds one.
"""

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sautereau.daq.convert.document import Document
from sautereau.daq.convert.options import ImportOptions
from sautereau.daq.errors import RecordingError
from sautereau.rig.registry import Registry

_OPENERS = {
    "from_loggers:open_tdms": "tdms",
    "from_tables:open_csv": "csv txt tsv dat asc prn log",
    "from_loggers:open_wav": "wav",
    "from_tables:open_parquet": "parquet",
    "from_arrays:open_mat": "mat",
    "from_arrays:open_numpy": "npy npz",
    "from_arrays:open_lvm": "lvm",
    "from_arrays:open_uff": "uff unv",
    "from_arrays:open_xlsx": "xlsx",
    "from_arrays:open_sound": "flac w64 aiff caf",
    "from_arrays:open_mdf": "mf4 mdf",
    "from_arrays:open_rosbag": "bag mcap db3",
    "from_arrays:open_hdf5": "h5 hdf5",
}
FORMATS = Registry(
    "sautereau.import_formats",
    "import format",
    {end: f"{__package__}.{place}" for place, ends in _OPENERS.items() for end in ends.split()},
    RecordingError,
)
"""Functions that open a file, by file extension in lower case, without the dot."""

NATIVE = {
    "svd": "it is Polytec's own format, which other programs cannot read; export it in PSV or"
    " VibSoft as a universal file (.uff) or as ASCII (.txt), with the time signals of the points,"
    " and import that",
}
"""How to export files of programs that alone read them, by file extension."""
NO_OPTIONS = ImportOptions()
LAYOUT = ("decimal", "skip")  # Options that a format takes to open a file
Columns = dict[str, NDArray[np.float64]]

MOST_ROWS = 20_000_000  # Limit of the samples of each channel, 390 s at 51.2 kHz


def place_of(row: int) -> str:
    """Return the place of a row, counted from 0, in a file without lines."""
    return f"row {row + 1}"


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
    dates: Mapping[str, str] = field(default_factory=dict)
    """The same by column, if it is a property of the columns and not of the file."""
    rows: int | None = None
    """Number of rows that the file states."""
    guess: str = ""
    """How the file is read, where it does not state its layout."""
    full_scale: bool = False
    """Whether the values are fractions of a full scale that the file does not give."""
    document: Document | None = None
    """Metadata of an export by sautereau; then nothing else is needed."""
    where: Callable[[int], str] = place_of
    """Returns the place of a row, counted from 0, for messages."""
    cut: str = ""
    """Why the file may be truncated; only the user knows whether it is. Empty without a reason."""


def extensions() -> str:
    """Return the file extensions of all registered formats, for help and messages."""
    return ", ".join(f".{name}" for name in FORMATS.names())


def open_source(
    path: Path, options: ImportOptions = NO_OPTIONS, columns: Sequence[str] = ()
) -> ImportSource:
    """Open a file in the format that is registered for its file extension.

    Args:
        path: The file.
        options: Those of the format itself are used: `decimal` and `skip` of a text table.
        columns: Columns that are imported; they decide between two ways to read a text table.

    Raises:
        RecordingError: The file does not exist, has an unknown extension, or is damaged.
    """
    if not path.is_file():
        found = "it is a folder; give a file in it"
        raise RecordingError(found if path.is_dir() else "no such file; check its name and folder")
    extension = path.suffix.lower().removeprefix(".")
    if extension not in FORMATS.names():
        if extension in NATIVE:
            raise RecordingError(NATIVE[extension])
        raise RecordingError(
            f"no import format is registered for the file extension {path.suffix!r}; convert the"
            f" file to one of {extensions()}, or add a format as docs/add-an-import-format.md shows"
        )
    opener = FORMATS.get(extension)
    known = inspect.signature(opener).parameters
    given = {name: value for name in LAYOUT if (value := getattr(options, name)) is not None}
    if useless := [f"--{name}" for name in given if name not in known]:
        raise RecordingError(f"a {path.suffix} file has no use for {', '.join(useless)}; remove it")
    return opener(path, **given, **({"columns": columns} if "columns" in known else {}))


@contextmanager
def reading(kind: str) -> Iterator[None]:
    """Report what a format's library raises, of a kind that depends on the bytes, as damage.

    Raises:
        RecordingError: The file is damaged, or not of the kind.
    """
    try:
        yield
    except RecordingError:
        raise
    except Exception as error:
        raise RecordingError(
            f"it is damaged, or not a {kind} file: {type(error).__name__}: {error}; use a copy of"
            " it"
        ) from error


def refuse_missing(
    name: str, missing: NDArray[np.bool_], where: Callable[[int], str] = place_of
) -> None:
    """Refuse a column with missing or infinite values.

    Args:
        missing: Which rows have no finite value, shape (n_rows,).
        where: Returns the place of a row, counted from 0.

    Raises:
        RecordingError: Gives the number of such rows and the first of them.
    """
    rows = np.flatnonzero(missing)
    if len(rows):
        raise RecordingError(
            f"column {name!r} has no finite number in {len(rows)} row{'s' * (len(rows) > 1)}, the"
            f" first is {where(int(rows[0]))}; gaps are never filled: cut the file before it"
        )


def refuse_rows(rows: int) -> None:
    """Refuse columns that are longer than `MOST_ROWS`, before they are read."""
    if rows > MOST_ROWS:
        raise RecordingError(
            f"its columns have {rows} rows, more than the limit of {MOST_ROWS}; cut it into"
            " shorter files, import each, and let `sautereau split` separate their presses"
        )
