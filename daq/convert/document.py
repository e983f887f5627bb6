"""Everything of a recording beside its samples, as one JSON document."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.recorded import Event, Joints, Plan, Recorded, Signal
from sautereau.daq.file.session_info import SessionInfo, session_from_metadata
from sautereau.daq.signals.quality_flags import find_marks
from sautereau.rig.errors import RigError
from sautereau.rig.load import rig_from_json, rig_json
from sautereau.rig.schema import Rig

FORMAT = "sautereau export 1"
"""Of the document; another number is another format."""


@dataclass(frozen=True)
class Document:
    """What an export tells beside its columns."""

    rig: Rig
    session: SessionInfo
    t0_ns: int
    """ns since 1970 of the trigger."""
    rate: float
    """Hz."""
    first_sample: int
    """Index of the first row, counted from the trigger."""
    samples_sha256: str
    """Of the raw volts, see `digest`."""
    plan: Plan | None
    joints: Joints | None
    events: tuple[Event, ...]


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def digest(volts: Sequence[Signal]) -> str:
    """Return the SHA-256 of raw volts as little-endian doubles, one channel after another."""
    found = hashlib.sha256()
    for signal in volts:
        found.update(np.ascontiguousarray(signal, dtype="<f8").tobytes())
    return found.hexdigest()


def document_text(recorded: Recorded, columns: dict[str, dict[str, str]]) -> str:
    """Return the document of a recording.

    Args:
        recorded: The recording.
        columns: Unit and meaning of each column of the export.
    """
    volts, rate = recorded.volts, recorded.rate
    found = [
        mark
        for channel in recorded.rig.daq.channels
        for mark in find_marks(volts[channel.name], channel, rate, recorded.first_sample)
    ]
    # A copy of the samples that are left must not pass for whole.
    lost = [Event(gap.start, "aborted", str(gap)) for gap in recorded.gaps]
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
            "events": [asdict(event) for event in (*recorded.events, *lost)],
            "plan": _lists(recorded.plan),
            "joints": _lists(recorded.joints),
            "marks": [asdict(mark) for mark in found],
        },
        indent=1,
    )


def read_document(text: str | bytes) -> Document:
    """Read back what `document_text` wrote.

    Raises:
        RecordingError: It is another document, or of another version.
    """
    try:
        found = json.loads(text)
        if found["format"] != FORMAT:
            raise RecordingError(
                f"its metadata are in the format {found['format']!r}, not {FORMAT!r}; read it with"
                " the version that wrote it"
            )
        return Document(
            rig=rig_from_json(json.dumps(found["rig"])),
            session=session_from_metadata(found["session"]),
            t0_ns=int(found["t0_ns"]),
            rate=float(found["rate"]),
            first_sample=int(found["first_sample"]),
            samples_sha256=str(found["samples_sha256"]),
            plan=_arrays(Plan, found["plan"]),
            joints=_arrays(Joints, found["joints"]),
            events=tuple(Event(**event) for event in found["events"]),
        )
    except (ValueError, KeyError, TypeError, RigError) as error:
        raise RecordingError(
            f"its metadata cannot be read: {type(error).__name__}: {error}; export the recording"
            " anew"
        ) from error


def _lists(series: Plan | Joints | None) -> dict[str, list[float]] | None:
    if series is None:
        return None
    return {field.name: getattr(series, field.name).tolist() for field in fields(series)}


def _arrays(kind: Any, lists: dict[str, list[float]] | None) -> Any:
    if lists is None:
        return None
    return kind(**{name: np.array(values, dtype=float) for name, values in lists.items()})
