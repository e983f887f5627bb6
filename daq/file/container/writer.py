"""Writing MCAP with the library's own writer, within the limits that our readers have."""

from collections.abc import Sequence
from typing import BinaryIO

from mcap.records import Channel, Metadata, Schema
from mcap.writer import CompressionType, Writer

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.records import (
    CHUNK_SIZE,
    COPY,
    LARGEST_CHUNK,
    LARGEST_DEFINITIONS,
    LIBRARY,
    crc32,
    record_bytes,
    with_checksum,
)

_OVERHEAD = 64 * 1024  # bytes of a chunk besides its only message: prefixes and definitions


def refuse_oversized(size: int) -> None:
    """Refuse a message of ``size`` bytes if it is larger than readers accept.

    Raises:
        RecordingError: It is.
    """
    if size + _OVERHEAD > LARGEST_CHUNK:
        raise RecordingError(
            f"a message of {size} bytes exceeds the limit of {LARGEST_CHUNK} bytes that readers"
            " accept; split it"
        )


class McapWriter(Writer):
    """Writes one MCAP file of messages in chunks; `flush` closes the open chunk."""

    def __init__(self, stream: BinaryIO, *, compress: bool = True):
        """Prepare for an empty stream.

        Args:
            stream: Written sequentially, never read.
            compress: Whether to compress chunks with zstd.
        """
        super().__init__(
            stream,
            chunk_size=CHUNK_SIZE,
            compression=CompressionType.ZSTD if compress else CompressionType.NONE,
            enable_data_crcs=True,  # the library's default leaves the end of the data unverified
        )
        # Sizes in bytes of Metadata by their checksums, since copies count once; under 0 that of
        # all schemas and channels.
        self._sizes: dict[int, int] = {}
        self._waiting = 0  # bytes of the definitions that the first message's chunk holds as well

    def begin(self, profile: str, definitions: Sequence[Schema | Channel]) -> None:
        """Write the header; the definitions go into the first chunk and the summary.

        Raises:
            ValueError: They are not numbered from 1 on.
        """
        self.start(profile, LIBRARY)
        for one in definitions:
            if isinstance(one, Schema):
                number = self.register_schema(one.name, one.encoding, one.data)
            else:
                number = self.register_channel(
                    one.topic, one.message_encoding, one.schema_id, one.metadata
                )
            if number != one.id:
                raise ValueError(f"number {one.id} where {number} is next")
        self._waiting = self._sizes[0] = sum(len(record_bytes(one)) for one in definitions)

    def add_metadata(self, name: str, data: dict[str, str], *, copy: bool = False) -> None:
        """Write a Metadata record with its own checksum immediately.

        Args:
            copy: Whether it repeats the record of this name.

        Raises:
            RecordingError: The different ones together are larger than readers accept.
        """
        if copy:
            super().add_metadata(name + COPY, with_checksum(name + COPY, data))
            return
        data = with_checksum(name, data)
        record = record_bytes(Metadata(name=name, metadata=data))
        self._sizes |= {crc32(record): len(record)}
        if (size := sum(self._sizes.values())) > LARGEST_DEFINITIONS:
            raise RecordingError(
                f"its definitions, with the {len(record)} bytes of the metadata {name}, have {size}"
                f" bytes, more than the limit of {LARGEST_DEFINITIONS}; shorten them"
            )
        super().add_metadata(name, data)

    def add_message(
        self, channel_id: int, log_time: int, data: bytes, publish_time: int, sequence: int = 0
    ) -> None:
        """Add a message to the open chunk; times are in ns since 1970.

        Raises:
            RecordingError: It is larger than readers accept.
        """
        refuse_oversized(self._waiting + len(data))
        if len(data) > LARGEST_CHUNK // 2:
            self.flush()  # the library closes a chunk only after the message that is too much
        super().add_message(channel_id, log_time, data, publish_time, sequence)
        self._waiting = 0
