"""Import formats: a registry by file extension, and what each of them returns of a file.

Also the document of an export: everything in a recording except its samples, as JSON.

A format is a function that takes a path and returns an `ImportSource`.
docs/add-an-import-format.md shows how another package adds one.
"""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.recorded import (
    Event,
    Joints,
    Plan,
    Recorded,
    SessionInfo,
    Signal,
    session_from_metadata,
)
from sautereau.daq.signals.quality_flags import find_quality_flags
from sautereau.rig.errors import RigError
from sautereau.rig.load import rig_from_json, rig_json
from sautereau.rig.registry import Registry
from sautereau.rig.schema import Rig

FORMATS = Registry(
    "sautereau.import_formats",
    "import format",
    {
        "tdms": "sautereau.daq.convert.from_loggers:open_tdms",
        "csv": "sautereau.daq.convert.from_tables:open_csv",
        "wav": "sautereau.daq.convert.from_loggers:open_wav",
        "parquet": "sautereau.daq.convert.from_tables:open_parquet",
    },
    RecordingError,
)
"""Functions that open a file, by file extension in lower case, without the dot."""

SIMULATED = "simulated"
"""Column that an export of a simulated recording has, so that the table alone shows it."""

Columns = dict[str, NDArray[np.float64]]

FORMAT = "sautereau export 1"
"""Name and version of the document's format."""
PARQUET_KEY = b"sautereau"
"""Key of the document in the metadata of a Parquet file's schema."""


@dataclass(frozen=True)
class Document:
    """What an export holds besides its columns."""

    rig: Rig
    session: SessionInfo
    t0_ns: int
    """Date of the trigger, ns since 1970."""
    rate: float
    """Sampling rate, Hz."""
    first_sample: int
    """Index of the first row, counted from the trigger."""
    samples_sha256: str
    """SHA-256 of the raw volts, see `digest`."""
    plan: Plan | None
    joints: Joints | None
    events: tuple[Event, ...]


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


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def digest(volts: Sequence[Signal]) -> str:
    """Return the SHA-256 of raw volts as little-endian doubles, one channel after another."""
    hashed = hashlib.sha256()
    for signal in volts:
        hashed.update(np.ascontiguousarray(signal, dtype="<f8").tobytes())
    return hashed.hexdigest()


def document_text(recorded: Recorded, columns: dict[str, dict[str, str]]) -> str:
    """Return the document of a recording.

    Args:
        recorded: The recording.
        columns: Unit and meaning of each column of the export.
    """
    volts, rate = recorded.volts, recorded.rate
    flags = [
        flag
        for channel in recorded.rig.daq.channels
        for flag in find_quality_flags(volts[channel.name], channel, rate, recorded.first_sample)
    ]
    # The gaps are exported as events, so that no import of the rest counts as complete.
    gaps = [Event(gap.start, "aborted", str(gap)) for gap in recorded.gaps]
    return json.dumps(
        {
            "format": FORMAT,
            "source": {"name": recorded.path.name, "sha256": sha256(recorded.path)},
            "columns": columns,
            "t0_ns": recorded.t0_ns,
            "rate": rate,
            "first_sample": recorded.first_sample,
            "samples_sha256": digest([volts[c.name] for c in recorded.rig.daq.channels]),
            "session": recorded.session.to_metadata(),
            "rig": json.loads(rig_json(recorded.rig)),
            "software": recorded.software,
            "events": [asdict(event) for event in (*recorded.events, *gaps)],
            "plan": _lists(recorded.plan),
            "joints": _lists(recorded.joints),
            "quality_flags": [asdict(flag) for flag in flags],
        },
        indent=1,
    )


def read_document(text: str | bytes) -> Document:
    """Read back what `document_text` wrote.

    Raises:
        RecordingError: It is not such a document, or one of another version.
    """
    try:
        values = json.loads(text)
        if values["format"] != FORMAT:
            raise RecordingError(
                f"its metadata are in the format {values['format']!r}, not {FORMAT!r}; read it with"
                " the version of sautereau that wrote it"
            )
        return Document(
            rig=rig_from_json(json.dumps(values["rig"])),
            session=session_from_metadata(values["session"]),
            t0_ns=int(values["t0_ns"]),
            rate=float(values["rate"]),
            first_sample=int(values["first_sample"]),
            samples_sha256=str(values["samples_sha256"]),
            plan=_arrays(Plan, values["plan"]),
            joints=_arrays(Joints, values["joints"]),
            events=tuple(Event(**event) for event in values["events"]),
        )
    except (ValueError, KeyError, TypeError, RigError) as error:
        raise RecordingError(
            f"its metadata cannot be read: {type(error).__name__}: {error}; export the recording"
            " again"
        ) from error


def _lists(series: Plan | Joints | None) -> dict[str, list[float]] | None:
    if series is None:
        return None
    return {field.name: getattr(series, field.name).tolist() for field in fields(series)}


def _arrays(kind: Any, lists: dict[str, list[float]] | None) -> Any:
    if lists is None:
        return None
    return kind(**{name: np.array(values, dtype=float) for name, values in lists.items()})
