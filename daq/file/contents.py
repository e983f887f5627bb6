"""The messages of a recording, and what is told at its head, as its records go by."""

import json
import struct
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Any

from google.protobuf.message import DecodeError
from mcap.exceptions import McapError
from mcap.records import Metadata

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.records import (
    CHANNEL,
    LARGEST_CHUNK,
    LARGEST_DEFINITIONS,
    MESSAGE,
    Opcode,
    Record,
    records_within,
    text_within,
    texts_within,
    unsealed,
)
from sautereau.daq.file.container.unpacking import unpacked
from sautereau.daq.file.recorded import Event, Joints, Plan
from sautereau.daq.file.schemas import FIELDS, decode, doubles
from sautereau.daq.file.session_info import SessionInfo, session_from_metadata
from sautereau.rig.errors import RigError
from sautereau.rig.load import rig_from_json
from sautereau.rig.schema import Rig

MOST_EVENTS = 100_000
"""Of a recording."""
MOST_UNPACKED = 500
"""1, of what chunks unpack to, over the size of the file; one of nothing but zeros has 300."""
FOREIGN = "another program has written it: take the file as sautereau left it"


class Contents:
    """What a recording tells beside its samples; grows as `messages` goes through it."""

    def __init__(self, size: int) -> None:
        """Begin with nothing of a file of ``size`` bytes."""
        self.metadata: dict[str, dict[str, str]] = {}
        self.channels: dict[str, dict[str, str]] = {}
        """Metadata of each topic."""
        self.counts: Counter[str] = Counter()
        """Messages of each topic."""
        self.events: list[Event] = []
        self.plan: Plan | None = None
        self.joints: Joints | None = None
        self._topics: dict[int, str] = {}
        self._counted: set[int] = set()
        self._definitions = 0
        self._seen: dict[bytes, Metadata] = {}
        self._unpacked = 0
        self._most = max(LARGEST_CHUNK, size * MOST_UNPACKED)

    def messages(self, records: Iterable[Record]) -> Iterator[Any]:
        """Yield every Samples message with its topic, and take note of all others.

        Raises:
            DamageError: A checksum does not hold.
            RecordingError: The records make no sense though the checksums hold.
        """
        try:
            for opcode, body in unpacked(records):
                if opcode != Opcode.CHUNK:
                    self._take(opcode, body)
                    continue
                self._bound(len(body))
                for inner, view, n in records_within(body, self._counted):
                    if inner == Opcode.MESSAGE:
                        topic = self._topics[MESSAGE.unpack_from(view)[0]]
                        self.counts[topic] += n
                        if topic.startswith("/daq/"):
                            yield topic, decode("Samples", bytes(view[MESSAGE.size :]))
                        else:
                            self._note(topic, view[MESSAGE.size :])
                    else:
                        self._take(inner, bytes(view))
        except (McapError, ValueError, KeyError, TypeError, struct.error, DecodeError) as error:
            raise RecordingError(
                f"its checksums hold but its records do not: {type(error).__name__}: {error};"
                f" {FOREIGN}"
            ) from error

    def rig(self) -> Rig:
        """Return the bench at the time."""
        self._want("rig", "software", "session")
        try:
            return rig_from_json(self.metadata["rig"].get("json", ""))
        except RigError as error:
            raise RecordingError(f"{error}; read it with the version that wrote it") from error

    def session(self) -> SessionInfo:
        """Return what the press was."""
        self._want("session")
        return session_from_metadata(self.metadata["session"])

    def end(self) -> int | None:
        """Return the index after the recording's last sample, where it was closed."""
        told = self.metadata.get("end")
        if told is None:
            return None
        try:
            return int(told["stop_sample"])
        except (KeyError, ValueError) as error:
            raise RecordingError(f"its end is told as {told}; {FOREIGN}") from error

    @property
    def recovered(self) -> bool:
        """Whether the file was made of what another one had left."""
        return "recovered" in self.metadata

    def _bound(self, size: int) -> None:
        self._unpacked += size
        if self._unpacked > self._most:
            raise RecordingError(
                f"it unpacks to more than the limit of {self._most} bytes, {MOST_UNPACKED} times"
                f" its size; {FOREIGN}"
            )

    def _want(self, *names: str) -> None:
        missing = [name for name in names if name not in self.metadata]
        if missing:
            raise RecordingError(
                f"it lacks the metadata {', '.join(missing)}; give a recording that sautereau has"
                " made"
            )

    def _take(self, opcode: int, body: bytes) -> None:
        """Take note of a definition."""
        if opcode not in (Opcode.METADATA, Opcode.CHANNEL):
            return
        self._definitions += len(body)
        if self._definitions > LARGEST_DEFINITIONS:
            raise RecordingError(
                f"its definitions exceed the limit of {LARGEST_DEFINITIONS} bytes; {FOREIGN}"
            )
        if opcode == Opcode.CHANNEL:
            topic, at = text_within(body, CHANNEL.size)
            _, at = text_within(body, at)  # encoding of its messages
            self._define(CHANNEL.unpack_from(body)[0], topic, texts_within(body, at))
            return
        record = self._seen.get(body)
        if record is not None and self.metadata[record.name] is record.metadata:
            return  # it stands at the head and at the end
        record = record or unsealed(body)
        self._seen[body] = record
        self.metadata[record.name] = record.metadata
        if record.name == "channels":
            for topic, text in record.metadata.items():
                told = json.loads(text)
                self._define(told["id"], topic, told["metadata"])

    def _define(self, number: int, topic: str, metadata: dict[str, str]) -> None:
        self._topics[number] = topic
        if topic.startswith("/preview/"):
            self._counted.add(number)
        self.channels[topic] = metadata

    def _note(self, topic: str, data: memoryview) -> None:
        if topic == "/events":
            if len(self.events) == MOST_EVENTS:
                raise RecordingError(
                    f"it has more events than the limit of {MOST_EVENTS}; {FOREIGN}"
                )
            event = decode("Event", bytes(data))
            self.events.append(Event(event.time, event.kind, event.text))
        elif topic == "/plan":
            plan = decode("Plan", bytes(data))
            self.plan = Plan(*map(doubles, (plan.t, plan.q1, plan.q2, plan.jack_rise)))
        elif topic == "/joints":
            joints = decode("Joints", bytes(data))
            self.joints = Joints(*(doubles(getattr(joints, name)) for name in FIELDS["Joints"]))
