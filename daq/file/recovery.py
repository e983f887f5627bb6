"""Repair: make a readable recording of the intact parts of a damaged one, which is kept."""

import json
import struct
from dataclasses import dataclass
from io import BufferedReader, BytesIO
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.records import Channel, Schema

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.chunks import find_intact, unpack_chunk
from sautereau.daq.file.container.durable import PART, DurableFile, McapWriter
from sautereau.daq.file.container.records import MESSAGE, Bytes, Opcode, records_within
from sautereau.daq.file.integrity import opened, verified
from sautereau.daq.file.provenance import HEAD, start_head
from sautereau.daq.file.recorded import Gap
from sautereau.daq.file.survey import Survey, survey
from sautereau.rig.disk import as_text, hold

ENDING = ".recovering.part"  # Appended to the name of a recovered recording until it is complete


@dataclass(frozen=True)
class Recovery:
    """Result of a recovery."""

    source: Path
    """The damaged file."""
    path: Path
    """The recovered file."""
    damage: str
    """What was wrong."""
    samples: dict[str, int]
    """Number of recovered samples, by channel."""
    rate: float
    """Sampling rate, Hz."""
    gaps: tuple[Gap, ...]
    """Missing samples."""


def recovered_path(path: Path) -> Path:
    """Return the name of a recovered file: without `.part`, or `name-recovered.mcap`.

    Raises:
        RecordingError: It is the working directory or the root.
    """
    if not path.name:
        raise RecordingError("it is a folder; name a recording")
    if path.suffix == PART:
        return path.with_suffix("")
    return path.with_name(f"{path.stem}-recovered.mcap")


def recover(path: str | Path, out: str | Path | None = None) -> Recovery:
    """Write every chunk of a recording whose checksum matches into a new recording.

    Args:
        path: The damaged file; it is only read.
        out: The new file, which must not exist. Default: `recovered_path`.

    Raises:
        RecordingError: The file needs no recovery, or nothing of it can be recovered.
    """
    path = Path(path)
    out = recovered_path(path) if out is None else Path(out)
    with opened(path, damaged=True) as file:
        if not hold(file):
            raise RecordingError("another process is writing it; wait until that session has ended")
        if not file.read(1):
            raise RecordingError("it is empty: nothing was recorded; delete it and press again")
        found = survey(file)
        if found.damage is None and path.suffix != PART:
            raise RecordingError("it is undamaged and needs no recovery; read it directly")
        clock = found.runs.clock
        if clock is None:
            raise RecordingError(
                "none of its samples is intact: no chunk with a matching checksum has any; use a"
                " copy of it, or press again"
            )
        damage = found.damage or "it is undamaged, but its press was aborted"
        with DurableFile(out, ending=ENDING).made() as stream:
            _write(McapWriter(stream), file, found, path.name, damage)
    return Recovery(
        source=path,
        path=out,
        damage=damage,
        samples={name: found.runs.count(name) for name in found.names},
        rate=clock.rate,
        gaps=found.gaps,
    )


def _write(writer: McapWriter, file: BufferedReader, found: Survey, name: str, damage: str) -> None:
    metadata = found.contents.metadata
    lost = [key for key in HEAD if key not in metadata]
    if lost:
        raise RecordingError(
            f"both copies of its metadata {', '.join(lost)} are damaged; use a copy of it"
        )
    if found.contents.renumbered:
        raise RecordingError(
            "another program has renumbered its topics, and the copies of its definitions have the"
            " old numbers; recover the file that sautereau wrote"
        )
    try:
        start_head(writer, {key: metadata[key] for key in HEAD})
    except (KeyError, ValueError, TypeError) as error:
        raise RecordingError(
            f"its definitions are invalid: {type(error).__name__}: {error}; use a copy of it"
        ) from error
    numbers = {number: number for number in range(1, len(metadata["channels"]) + 1)}
    schemas: dict[int, Schema] = {}
    for record in find_intact(file) if found.damage else verified(file):
        if record.opcode == Opcode.CHUNK:
            try:
                _copy(unpack_chunk(record.body), writer, numbers, schemas)
            except (EndOfFile, UnicodeDecodeError, KeyError, struct.error) as error:
                raise RecordingError(
                    "a chunk whose checksum is right has an invalid record:"
                    f" {type(error).__name__}: {error}; another program has written it"
                ) from error
    end = found.contents.end()
    if end is None and found.damage is None:
        end = found.runs.last()
    if end is not None:
        writer.add_metadata("end", metadata.get("end", {}) | {"stop_sample": str(end)})
    missing = json.dumps([gap.document() for gap in found.gaps])
    found_in = {"from": as_text(name), "damage": damage, "missing": missing}
    writer.add_metadata("recovered", found_in)
    writer.finish()


def _copy(
    chunk: Bytes, writer: McapWriter, numbers: dict[int, int], schemas: dict[int, Schema]
) -> None:
    """Copy the messages of an unpacked chunk into a chunk of their own.

    Args:
        numbers: Number of each MCAP channel in the new file, by its number in the damaged one.
            Topics that another program has added are appended.
        schemas: Those of the damaged file so far, by their numbers in it.
    """
    for opcode, body, _ in records_within(chunk):
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(ReadDataStream(BytesIO(body)))
            schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            one = Channel.read(ReadDataStream(BytesIO(body)))
            if one.id not in numbers:
                used = schemas.get(one.schema_id)
                own = writer.register_schema(used.name, used.encoding, used.data) if used else 0
                numbers[one.id] = writer.register_channel(
                    one.topic, one.message_encoding, own, one.metadata
                )
        elif opcode == Opcode.MESSAGE:
            number, sequence, log_time, publish_time = MESSAGE.unpack_from(body)
            data = bytes(body[MESSAGE.size :])
            writer.add_message(numbers[number], log_time, data, publish_time, sequence)
    writer.flush()
