"""The document of an export: everything in a recording except its samples, as JSON."""

import hashlib
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.limits import MOST_EVENTS, event_faults, series_faults, time_faults
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
from sautereau.rig import disk
from sautereau.rig.acquisition import Channel
from sautereau.rig.disk import explained, read_limited
from sautereau.rig.document import rig_from_json, rig_json
from sautereau.rig.errors import RigError
from sautereau.rig.faults import fault_list
from sautereau.rig.schema import Rig

SIMULATED = "simulated"
"""Column that an export of a simulated recording has, so that the table alone shows it."""
FORMAT = "sautereau export 1"  # Name and version of the document's format
DOCUMENT_KEY = "sautereau"  # Name of the document in an HDF5 or TDMS file
PARQUET_KEY = DOCUMENT_KEY.encode()
"""Key of the document in the metadata of a Parquet file's schema."""
SIDECAR = ".json"
"""Appended to the name of an exported file to name the file that holds its document."""

Parts = dict[str, Callable[[BinaryIO], object]]
"""Files of an export: by what is appended to the name, a function that writes the file."""


@dataclass(frozen=True)
class Document:
    """What an export holds besides its columns."""

    rig: Rig
    session: SessionInfo
    t0_ns: int
    """Date of the trigger, ns since 1970."""
    t0_std: float | None
    """Its standard uncertainty, s; None if it is unknown."""
    rate: float
    """Sampling rate, Hz."""
    first_sample: int
    """Index of the first row, counted from the trigger."""
    samples_sha256: str
    """SHA-256 of the raw volts, see `digest`."""
    plan: Plan | None
    joints: Joints | None
    events: tuple[Event, ...]


def digest(volts: Sequence[Signal]) -> str:
    """Return the SHA-256 of raw volts as little-endian doubles, one channel after another."""
    hashed = hashlib.sha256()
    for signal in volts:
        hashed.update(np.ascontiguousarray(signal, dtype="<f8").tobytes())
    return hashed.hexdigest()


def volts_name(channel: str) -> str:
    """Return the name of the column of a channel's raw volts."""
    return f"{channel} [V]"


def full_scale(channel: Channel) -> float:
    """Return the volts of the value 1 in an exported WAV file, V: a power of two."""
    return 2.0 ** math.ceil(math.log2(channel.range))


def document_text(recorded: Recorded, columns: dict[str, dict[str, str]]) -> str:
    """Return the document of a recording.

    Args:
        columns: Unit and meaning of each column of the export.
    """
    volts, rate = recorded.volts, recorded.rate
    flags = [
        flag
        for channel in recorded.rig.daq.channels
        for flag in find_quality_flags(volts[channel.name], channel, rate, recorded.first_sample)
    ]
    return json.dumps(
        {
            "format": FORMAT,
            "source": {"name": recorded.path.name, "sha256": disk.digest(recorded.path)},
            "columns": columns,
            "full_scale": {c.name: full_scale(c) for c in recorded.rig.daq.channels},
            "t0_ns": recorded.t0_ns,
            "t0_std": recorded.t0_std,
            "rate": rate,
            "first_sample": recorded.first_sample,
            "samples_sha256": digest([volts[c.name] for c in recorded.rig.daq.channels]),
            "session": recorded.session.to_metadata(),
            "rig": json.loads(rig_json(recorded.rig)),
            "software": recorded.software,
            "events": [asdict(event) for event in recorded.events_and_gaps],
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
        document = Document(
            rig=rig_from_json(json.dumps(values["rig"])),
            session=session_from_metadata(values["session"]),
            t0_ns=int(values["t0_ns"]),
            t0_std=values.get("t0_std"),
            rate=float(values["rate"]),
            first_sample=int(values["first_sample"]),
            samples_sha256=str(values["samples_sha256"]),
            plan=_arrays(Plan, values["plan"]),
            joints=_arrays(Joints, values["joints"]),
            events=tuple(Event(**event) for event in values["events"]),
        )
    except (ValueError, KeyError, TypeError, ArithmeticError, RecursionError, RigError) as error:
        raise RecordingError(
            f"its metadata cannot be read: {type(error).__name__}: {error}; export the recording"
            " again"
        ) from error
    if faults := _faults(document):
        raise RecordingError(f"{fault_list('its metadata', faults)}; export the recording again")
    return document


def read_sidecar(path: Path) -> Document | None:
    """Return the document in ``NAME.json`` beside a file, if there is one.

    Raises:
        RecordingError: It cannot be read.
    """
    sidecar = path.with_name(path.name + SIDECAR)
    if not sidecar.is_file():
        return None
    with explained(RecordingError, f"its metadata {sidecar}", "use a copy"):
        return read_document(read_limited(sidecar, 200_000_000))  # 200 MB


def _faults(document: Document) -> list[str]:
    """Return the values of a document that are beyond what a recording can hold."""
    faults = time_faults(document.t0_ns, document.rate, document.first_sample)
    std = document.t0_std
    if std is not None and not (isinstance(std, int | float) and 0 <= std < math.inf):
        faults.append(f"t0_std: {std!r} is not a finite number from 0 s up")
    if len(document.events) >= MOST_EVENTS:  # the import adds one
        faults.append(
            f"events: {len(document.events)} are not below the limit MOST_EVENTS = {MOST_EVENTS}"
        )
    return [
        *faults,
        *event_faults(document.events),
        *series_faults("plan", document.plan),
        *series_faults("joints", document.joints),
    ]


def _lists(series: Plan | Joints | None) -> dict[str, list[float]] | None:
    if series is None:
        return None
    return {name: values.tolist() for name, values in vars(series).items()}


def _arrays(kind: Any, lists: dict[str, list[float]] | None) -> Any:
    if lists is None:
        return None
    if not isinstance(lists, dict):
        raise TypeError(f"{kind.__name__} is no object of arrays")
    return kind(**{name: np.array(values, dtype=float) for name, values in lists.items()})
