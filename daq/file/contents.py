"""The messages and metadata of a recording, collected while its records are read."""

import math
import struct
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress

from google.protobuf.message import DecodeError
from mcap.exceptions import McapError

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.chunks import MOST_UNPACKED, has_checksum, unpacked
from sautereau.daq.file.container.records import (
    LARGEST_CHUNK,
    LARGEST_DEFINITIONS,
    MESSAGE,
    Opcode,
    Record,
    read_channel,
    read_metadata,
    records_within,
)
from sautereau.daq.file.integrity import FOREIGN, IndexedChunk
from sautereau.daq.file.limits import FARTHEST_SAMPLE, MOST_EVENTS, event_faults, series_faults
from sautereau.daq.file.provenance import channel_from_json
from sautereau.daq.file.recorded import (
    Event,
    Joints,
    Plan,
    SessionInfo,
    session_from_metadata,
    whole_number,
)
from sautereau.daq.file.samples import (
    TOPIC,
    SampleLayout,
    WireBlock,
    layout_from_metadata,
    read_block,
)
from sautereau.daq.file.schemas import FIELDS, LOG, decode, doubles
from sautereau.rig.document import rig_from_json
from sautereau.rig.errors import RigError
from sautereau.rig.faults import fault_list
from sautereau.rig.schema import Rig
from sautereau.rig.units import shown

VIEWED = ("/preview", "/motion", "/scene", "/transforms")
"""Prefixes of the topics for viewers. Their messages are counted and not read."""
LEAST_RECORDS = 200_000
"""Limit of the records in the chunks of any file. A run of equally long previews counts as one."""
SMALLEST_RECORD = 16  # Bytes of a file that allow it one more record


class Contents:
    """What a recording holds besides its samples; `blocks` fills it while it reads."""

    def __init__(self, size: int) -> None:
        """Start empty, for a file of ``size`` bytes."""
        self.metadata: dict[str, dict[str, str]] = {}
        self.channels: dict[str, dict[str, str]] = {}
        """Metadata of each topic."""
        self.counts: Counter[str] = Counter()
        """Number of messages of each topic."""
        self.events: list[Event] = []
        self.plan: Plan | None = None
        self.joints: Joints | None = None
        self.renumbered = False
        """Whether a Channel record has another number than the Metadata `channels` say."""
        self.unchecked = False
        """Whether messages are outside chunks, or in chunks without a checksum."""
        self._topics: dict[int, str] = {}
        self._declared: set[int] = set()
        self._counted: set[int] = set()
        self._definitions = 0
        self._layouts: dict[str, SampleLayout] = {}
        self._unpacked = 0
        self._most = max(LARGEST_CHUNK, size * MOST_UNPACKED)
        self._records = LEAST_RECORDS + size // SMALLEST_RECORD

    def blocks(self, records: Iterable[Record]) -> Iterator[tuple[SampleLayout, WireBlock]]:
        """Yield every block of samples with its layout, and store all other messages.

        Raises:
            DamageError: A checksum does not match.
            RecordingError: The checksums match but the records are invalid.
        """
        try:
            for opcode, body in unpacked(self._noted(records)):
                inside = iter([(opcode, memoryview(body), 1)])
                if opcode == Opcode.CHUNK:
                    self._limit_unpacked(len(body))
                    inside = records_within(body, self._counted)
                for inner, view, n in inside:
                    self._count_record()
                    if inner != Opcode.MESSAGE:
                        self._read_definition(inner, bytes(view))
                        continue
                    number = MESSAGE.unpack_from(view)[0]
                    topic = self._topics[number]
                    self.counts[topic] += n
                    if number in self._counted:
                        continue
                    data = view[MESSAGE.size :]
                    if layout := self._layouts.get(topic):
                        yield layout, read_block(data)
                    elif topic.startswith("/daq/"):
                        yield _of_format_1(topic, data)
                    else:
                        self._read_message(topic, data)
        except RecordingError:
            raise
        except (McapError, ValueError, KeyError, struct.error, DecodeError) as error:
            raise RecordingError(
                f"its checksums match but its records are invalid: {type(error).__name__}:"
                f" {error}; {FOREIGN}"
            ) from error

    def _noted(self, records: Iterable[Record]) -> Iterator[Record]:
        for record in records:
            self.unchecked |= record.opcode == Opcode.MESSAGE or (
                record.opcode == Opcode.CHUNK and not has_checksum(record.body)
            )
            yield record

    def rig(self) -> Rig:
        """Return the rig as it was when recorded."""
        self._require("rig", "software", "session")
        try:
            return rig_from_json(self.metadata["rig"].get("json", ""))
        except RigError as error:
            raise RecordingError(
                f"{error}; read it with the version of sautereau that wrote it"
            ) from error

    def session(self) -> SessionInfo:
        """Return the description of the press."""
        self._require("session")
        return session_from_metadata(self.metadata["session"])

    def with_samples(self, chunks: list[IndexedChunk]) -> list[IndexedChunk]:
        """Return the chunks that have samples, each with the latest date that these can have.

        The log time of a block is that of its last sample in format 1, else of its first.
        """
        if not self._layouts:
            return chunks
        numbers = {number for number, topic in self._topics.items() if topic in self._layouts}
        found = [chunk for chunk in chunks if numbers & chunk.channels]
        dates = [*(chunk.last for chunk in found), 2**64][1:]
        return [chunk._replace(last=date) for chunk, date in zip(found, dates, strict=True)]

    def end(self) -> int | None:
        """Return the index after the last sample; None if the recording was never closed."""
        end = self.metadata.get("end")
        if end is None:
            return None
        try:
            return whole_number(end["stop_sample"], FARTHEST_SAMPLE)
        except (KeyError, ValueError) as error:
            raise RecordingError(f"its metadata `end` are {shown(end)}; {FOREIGN}") from error

    @property
    def t0_std(self) -> float | None:
        """Standard uncertainty of the date of the trigger, s; None if it is unknown."""
        text = self.metadata.get("end", {}).get("t0_std")
        if text is None:
            return None
        with suppress(ValueError):
            if 0 <= (std := float(text)) < math.inf:
                return std
        raise RecordingError(f"its metadata `end` have t0_std = {shown(text)}; {FOREIGN}")

    @property
    def recovered(self) -> bool:
        """Whether `recover` made the file from a damaged one."""
        return "recovered" in self.metadata

    def _count_record(self) -> None:
        self._records -= 1
        if self._records < 0:
            raise RecordingError(
                f"it has more records than the limit of LEAST_RECORDS = {LEAST_RECORDS} and one"
                f" for each SMALLEST_RECORD = {SMALLEST_RECORD} bytes of it; {FOREIGN}"
            )

    def _limit_unpacked(self, size: int) -> None:
        self._unpacked += size
        if self._unpacked > self._most:
            raise RecordingError(
                f"it unpacks to more than the limit of {self._most} bytes, {MOST_UNPACKED} times"
                f" its size; {FOREIGN}"
            )

    def _require(self, *names: str) -> None:
        missing = [name for name in names if name not in self.metadata]
        if missing:
            raise RecordingError(
                f"it lacks the metadata {', '.join(missing)}; give the recording as sautereau wrote"
                " it, or a copy with its metadata (`mcap filter --include-metadata`)"
            )

    def _read_definition(self, opcode: int, body: bytes) -> None:
        """Store a Metadata or Channel record."""
        if opcode not in (Opcode.METADATA, Opcode.CHANNEL):
            return
        if opcode == Opcode.CHANNEL:
            number, topic, metadata = read_channel(body)
            if number in self._declared and self._is(number, topic, metadata):
                return  # it is repeated
            self._limit_definitions(len(body))
            self.renumbered |= self._topics.get(number, topic) != topic
            self._declared.add(number)
            self._define(number, topic, metadata)
            return
        record = read_metadata(body)
        if self.metadata.get(record.name) == record.metadata:
            return  # it is written twice
        self._limit_definitions(len(body))
        self.metadata[record.name] = dict(record.metadata)
        if record.name == "channels":
            for topic, text in record.metadata.items():
                number, _, metadata = channel_from_json(topic, text)
                if number in self._declared:
                    self.renumbered |= self._topics[number] != topic
                else:
                    self._define(number, topic, metadata)

    def _limit_definitions(self, size: int) -> None:
        """Count the bytes of a definition that is not a copy, as the writer does."""
        self._definitions += size
        if self._definitions > LARGEST_DEFINITIONS:
            raise RecordingError(
                f"its definitions exceed the limit of {LARGEST_DEFINITIONS} bytes; {FOREIGN}"
            )

    def _is(self, number: int, topic: str, metadata: dict[str, str]) -> bool:
        return self._topics.get(number) == topic and self.channels.get(topic) == metadata

    def _define(self, number: int, topic: str, metadata: dict[str, str]) -> None:
        if self._is(number, topic, metadata):
            return  # it is in the Metadata and in a record of its own
        self._topics[number] = topic
        (self._counted.add if topic.startswith(VIEWED) else self._counted.discard)(number)
        if topic == TOPIC:
            self._layouts[topic] = layout_from_metadata(metadata)
        self.channels[topic] = dict(metadata)

    def _read_message(self, topic: str, data: memoryview) -> None:
        if topic == "/events":
            if len(self.events) == MOST_EVENTS:
                raise RecordingError(
                    f"it has more events than the limit of {MOST_EVENTS}; {FOREIGN}"
                )
            self.events.append(self._event(bytes(data)))
            self._refuse(event_faults(self.events[-1:]))
        elif topic == "/plan":
            plan = decode("Plan", bytes(data))
            found = Plan(*map(doubles, (plan.t, plan.q1, plan.q2, plan.jack_rise)))
            self._refuse(series_faults("plan", found))
            self.plan = found if len(found.t) else None
        elif topic == "/joints":
            joints = decode("Joints", bytes(data))
            self.joints = Joints(*(doubles(getattr(joints, name)) for name in FIELDS["Joints"]))
            self._refuse(series_faults("joints", self.joints))

    def _event(self, data: bytes) -> Event:
        if "format" in self.metadata.get("schemas", {}):
            log = decode(LOG, data)
            return Event(log.time, log.name, log.message, log.std)
        event = decode("Event", data)
        return Event(event.time, event.kind, event.text, event.std)

    def _refuse(self, faults: list[str]) -> None:
        if faults:
            raise RecordingError(f"{fault_list('its records', faults)}; {FOREIGN}")


def _of_format_1(topic: str, data: memoryview) -> tuple[SampleLayout, WireBlock]:
    """Return a block of format 1, which holds one channel."""
    block = decode("Samples", bytes(data))
    layout = SampleLayout((topic.removeprefix("/daq/"),), "float64", ())
    volts = memoryview(block.volts)
    return layout, WireBlock(block.t0, block.first_sample, block.rate, block.begin, volts)
