"""A file of another program, as an import sees it: named columns and what it tells of them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sautereau.daq.convert.document import Document
from sautereau.daq.errors import RecordingError

SIMULATED = "simulated"
"""Column that an export of a simulated recording has, so that the table alone tells."""

Columns = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Source:
    """One open file; what is None or not there, it does not tell."""

    kind: str
    """Of the format, for texts."""
    names: tuple[str, ...]
    """Of its columns."""
    read: Callable[[list[str]], Columns]
    """Returns some columns, each of shape (n,)."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Of a column's values, where the file tells it."""
    rates: Mapping[str, float] = field(default_factory=dict)
    """Hz, of a column, where the file tells it."""
    starts: Mapping[str, float] = field(default_factory=dict)
    """s, of a column's first sample on the file's own axis of time."""
    started: str | None = None
    """When it was recorded, ISO 8601."""
    full_scale: bool = False
    """Whether the values are shares of a full scale that the file does not tell."""
    document: Document | None = None
    """Of an export by sautereau, which lacks nothing."""


def open_source(path: Path) -> Source:
    """Open a file of one of the formats that are read, which its suffix tells.

    Raises:
        RecordingError: It is missing, of another format, or damaged.
    """
    if not path.is_file():
        raise RecordingError("there is no such file; see its name and folder")
    suffix = path.suffix.lower()
    if suffix == ".parquet":
        from sautereau.daq.convert.from_parquet import open_parquet as opener
    elif suffix == ".csv":
        from sautereau.daq.convert.from_csv import open_csv as opener
    elif suffix == ".tdms":
        from sautereau.daq.convert.from_tdms import open_tdms as opener
    elif suffix == ".wav":
        from sautereau.daq.convert.from_wav import open_wav as opener
    else:
        raise RecordingError(
            f"files that end in {suffix!r} are not read; give a .tdms, .csv, .wav or .parquet file"
        )
    return opener(path)
