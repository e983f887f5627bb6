"""Read a recording back, whole or not at all."""

import struct
from collections import Counter
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from google.protobuf.message import DecodeError
from mcap.exceptions import McapError
from mcap.records import Channel, Message, Metadata
from mcap.stream_reader import StreamReader

from daq.errors import RecordingError
from daq.integrity import check_whole
from daq.recorded import Description, Event, Joints, Plan, Recorded, Signal
from daq.schemas import decode, doubles
from daq.session_info import SessionInfo, session_from_metadata
from rig.errors import RigError
from rig.load import rig_from_json
from rig.schema import Rig

Series = TypeVar("Series", Plan, Joints)

__all__ = ["Description", "Event", "Joints", "Plan", "Recorded", "describe", "read_recording"]


@dataclass
class _Contents:
    """The records of a file, by topic and name, messages not yet decoded."""

    size: int
    topics: dict[int, Channel] = field(default_factory=dict)
    messages: dict[str, list[bytes]] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)

    @property
    def channels(self) -> dict[str, dict[str, str]]:
        return {channel.topic: dict(channel.metadata) for channel in self.topics.values()}

    def of(self, topic: str) -> list[bytes]:
        return self.messages.get(topic, [])


@dataclass(frozen=True)
class _Samples:
    """All channels, joined from their blocks; t0 and rate are None without a sample."""

    volts: dict[str, Signal]
    t0_ns: int | None
    rate: float | None


def read_recording(path: str | Path) -> Recorded:
    """Read one press.

    Returns:
        Raw volts bit for bit, with everything that was recorded beside them.

    Raises:
        RecordingError: The file is missing, not ours, cut short, changed by a single byte,
            lacks a stretch of samples, or holds none.
    """
    path = Path(path)
    try:
        contents = _load(path)
        rig, session = _head(contents)
        samples = _samples(contents, rig)
        if samples.t0_ns is None or samples.rate is None:
            raise RecordingError(
                "it holds no samples: the press ended before the trigger came; its events say"
                " why: press again"
            )
        return Recorded(
            path=path,
            rig=rig,
            session=session,
            t0_ns=samples.t0_ns,
            rate=samples.rate,
            volts=samples.volts,
            plan=_last(contents, "Plan", Plan),
            joints=_last(contents, "Joints", Joints),
            events=_events(contents),
            software=contents.metadata["software"],
            channels=contents.channels,
        )
    except RecordingError as error:
        raise RecordingError(f"recording {path}: {error}") from error.__cause__


def describe(path: str | Path) -> Description:
    """Tell what a recording holds, one without samples too; raises as `read_recording`."""
    path = Path(path)
    try:
        contents = _load(path)
        rig, session = _head(contents)
        samples = _samples(contents, rig)
        events = _events(contents)
    except RecordingError as error:
        raise RecordingError(f"recording {path}: {error}") from error.__cause__
    n_samples = len(next(iter(samples.volts.values())))
    return Description(
        path=str(path),
        size=contents.size,
        rig=rig.name,
        simulated=session.simulated,
        complete=all(event.kind != "aborted" for event in events),
        session=session.to_metadata(),
        rate=samples.rate,
        n_samples=n_samples,
        duration=n_samples / samples.rate if samples.rate else 0.0,
        channels=contents.channels,
        messages={topic: len(contents.of(topic)) for topic in contents.channels},
        events=[f"{event.time:.6f} s {event.kind}: {event.text}" for event in events],
        software=contents.metadata["software"],
    )


def _load(path: Path) -> _Contents:
    if path.is_dir():
        raise RecordingError("it is a folder; give one of the .mcap files in it")
    try:
        data = path.read_bytes()
    except FileNotFoundError as error:
        raise RecordingError("there is no such file; see its name and folder") from error
    except OSError as error:
        raise RecordingError(f"it cannot be opened: {error.strerror}; see its rights") from error
    check_whole(data)
    contents = _Contents(size=len(data))
    try:
        for record in StreamReader(BytesIO(data), validate_crcs=True).records:
            if isinstance(record, Channel):
                contents.topics[record.id] = record
            elif isinstance(record, Message):
                topic = contents.topics[record.channel_id].topic
                contents.messages.setdefault(topic, []).append(record.data)
            elif isinstance(record, Metadata):
                contents.metadata[record.name] = record.metadata
    except (McapError, ValueError, KeyError, struct.error) as error:
        raise RecordingError(
            f"its checksums hold but its records do not: {type(error).__name__}: {error}; another"
            " program has written it: take the file as sautereau left it"
        ) from error
    return contents


def _head(contents: _Contents) -> tuple[Rig, SessionInfo]:
    missing = [n for n in ("rig", "software", "session") if n not in contents.metadata]
    if missing:
        raise RecordingError(
            f"it lacks the metadata {', '.join(missing)}; give a recording that sautereau has made"
        )
    try:
        rig = rig_from_json(contents.metadata["rig"].get("json", ""))
    except RigError as error:
        raise RecordingError(f"{error}; read it with the version that wrote it") from error
    return rig, session_from_metadata(contents.metadata["session"])


def _samples(contents: _Contents, rig: Rig) -> _Samples:
    volts: dict[str, Signal] = {}
    clocks: Counter[tuple[int, float]] = Counter()
    for channel in rig.daq.channels:
        blocks, there = [], 0
        for data in contents.of(f"/daq/{channel.name}"):
            block = _decoded("Samples", data)
            clocks[block.t0, block.rate] += 1
            if block.first_sample != there:
                raise RecordingError(_hole(channel.name, there, block.first_sample, block.rate))
            blocks.append(doubles(block.volts))
            there += len(blocks[-1])
        volts[channel.name] = np.concatenate(blocks) if blocks else np.empty(0)
    if len(clocks) > 1:
        raise RecordingError(
            f"its blocks tell {len(clocks)} different triggers or rates; another program has"
            " written it: take the file as sautereau left it"
        )
    t0_ns, rate = next(iter(clocks), (None, None))
    longest = max(map(len, volts.values()))
    for name, signal in volts.items():
        if len(signal) != longest:
            raise RecordingError(_hole(name, len(signal), longest, rate or rig.daq.sample_rate))
    return _Samples(volts, t0_ns, rate)


def _hole(name: str, expected: int, found: int, rate: float) -> str:
    if found < expected:
        return f"samples {found} to {expected - 1} of {name} are there twice; press again"
    return (
        f"samples {expected} to {found - 1} of {name} are missing, {expected / rate * 1e3:.6g} ms"
        f" to {found / rate * 1e3:.6g} ms; a hole is never filled: press again"
    )


def _last(contents: _Contents, message: str, kind: type[Series]) -> Series | None:
    found = contents.of(f"/{message.lower()}")
    if not found:
        return None
    decoded = _decoded(message, found[-1])
    return kind(**{name: doubles(getattr(decoded, name)) for name in kind.__dataclass_fields__})


def _events(contents: _Contents) -> tuple[Event, ...]:
    decoded = (_decoded("Event", data) for data in contents.of("/events"))
    return tuple(Event(event.time, event.kind, event.text) for event in decoded)


def _decoded(message: str, data: bytes) -> Any:
    try:
        return decode(message, data)
    except DecodeError as error:
        raise RecordingError(
            f"a {message} message of it cannot be decoded: {error}; read it with the version"
            " that wrote it"
        ) from error
