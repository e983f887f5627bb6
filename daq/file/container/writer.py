"""Writing an MCAP file of any length in constant memory: chunks, their index, summary.

The records are those of the mcap library. Its own ``Writer`` keeps the index of all chunks in
memory, 2.5 kB per chunk: 230 MB for an hour of 16 channels at 51.2 kHz. Here it is spooled.
"""

import struct
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from tempfile import SpooledTemporaryFile
from typing import BinaryIO

import numpy as np
import zstandard
from mcap.records import (
    Channel,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from numpy.typing import NDArray

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.checksum import crc32
from sautereau.daq.file.container.chunks import CHUNK, ZSTD
from sautereau.daq.file.container.open_chunk import INDEX_ENTRY, OpenChunk, indexed
from sautereau.daq.file.container.records import (
    CHUNK_INDEX,
    CHUNK_SIZE,
    INDEX_OFFSET,
    LARGEST_CHUNK,
    LARGEST_DEFINITIONS,
    LIBRARY,
    MAGIC,
    MESSAGE,
    PREFIX,
    Bytes,
    Opcode,
    record_bytes,
    with_checksum,
)

_SIZE = struct.Struct("<Q")
_INDEX_HEAD = struct.Struct("<HI")  # channel, size of the entries
_INDEX_SIZE = struct.Struct("<QI")
"""In a ChunkIndex after the offsets: size of the MessageIndex records, length of the compression's
name."""
LEVEL = 1
"""Compression level of zstd: 1.6 times as fast as its default of 3 on a converter's samples,
with files of the same size."""
_OVERHEAD = 64 * 1024  # bytes of a chunk besides its only message: prefixes and definitions
_SPOOLED = 1024**2  # bytes of the chunk index kept in memory


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


class McapWriter:
    """Writes one MCAP file of messages in chunks to a binary stream."""

    def __init__(self, stream: BinaryIO, folder: Path, *, compress: bool = True):
        """Start at the beginning of an empty stream.

        Args:
            stream: Written sequentially, never read.
            folder: Folder of the unnamed temporary file for a long recording's index.
            compress: Whether to compress chunks with zstd.
        """
        self._stream = stream
        self._compressor = zstandard.ZstdCompressor(LEVEL) if compress else None
        self._compression = ZSTD if compress else b""
        self._crc = 0
        self._at = 0
        self._definitions: list[Schema | Channel] = []
        self._defined: dict[int, int] = {}  # sizes in bytes of different records, by checksum
        self._metadata: list[MetadataIndex] = []
        self._spool: SpooledTemporaryFile[bytes] = SpooledTemporaryFile(  # noqa: SIM115
            _SPOOLED, dir=str(folder)
        )
        self._n_chunks = 0
        self._counts: Counter[int] = Counter()
        self._first: int | None = None
        self._last = 0
        self._open = OpenChunk()

    def start(self, profile: str, definitions: Sequence[Schema | Channel]) -> None:
        """Write the header; the definitions go into the first chunk and the summary."""
        self._definitions = list(definitions)
        self._put(MAGIC + record_bytes(Header(profile, LIBRARY)))
        self._open.put(*map(record_bytes, self._definitions))
        self._defined[0] = self._open.size

    def add_metadata(self, name: str, data: dict[str, str]) -> None:
        """Write a Metadata record with its own checksum immediately.

        Raises:
            RecordingError: The different ones together are larger than readers accept.
        """
        record = record_bytes(Metadata(name=name, metadata=with_checksum(name, data)))
        self._defined |= {crc32(record): len(record)}
        if (size := sum(self._defined.values())) > LARGEST_DEFINITIONS:
            raise RecordingError(
                f"its definitions, with the {len(record)} bytes of the metadata {name}, have {size}"
                f" bytes, more than the limit of {LARGEST_DEFINITIONS}; shorten them"
            )
        self._metadata.append(MetadataIndex(offset=self._at, length=len(record), name=name))
        self._put(record)

    def add_message(self, channel: int, log_time: int, *data: Bytes) -> None:
        """Add a message in parts to the open chunk; its log time is also its publish time.

        The parts are copied when the chunk is closed: they must not change until then.

        Raises:
            RecordingError: It is larger than readers accept.
        """
        size = sum(map(len, data))
        refuse_oversized(size)
        if self._open.size + size + MESSAGE.size > LARGEST_CHUNK:
            self.close_chunk(least=0)
            refuse_oversized(self._open.size + size)  # definitions may be left
        self._open.add(channel, log_time, *data)

    def add_run(self, channel: int, log_times: NDArray[np.int64], data: NDArray[np.void]) -> None:
        """Add messages of equal length at once; see `OpenChunk.add_run`."""
        if len(data):
            self._open.add_run(channel, log_times, data)

    def close_chunk(self, least: int = CHUNK_SIZE) -> None:
        """Write the open chunk, if it has at least ``least`` bytes and one message."""
        open_chunk = self._open
        if not open_chunk.times or open_chunk.size < least:
            return
        self._open, parts = OpenChunk(), open_chunk.parts
        crc = 0
        for part in parts:
            crc = crc32(part, crc)
        if self._compressor:
            packer = self._compressor.compressobj(size=open_chunk.size)
            parts = [*map(packer.compress, parts), packer.flush()]
        times = min(open_chunk.times), max(open_chunk.times)
        head = CHUNK.pack(*times, open_chunk.size, crc, len(self._compression)) + self._compression
        self._write_chunk(head, parts, open_chunk)

    def copy_chunk(self, body: Bytes, records: Bytes) -> None:
        """Copy a chunk of another file unchanged; ``records`` are its content unpacked.

        The definitions are written before the first one, which may have none.
        """
        self._put(*self._open.parts)
        self._open = OpenChunk()
        *_, length = CHUNK.unpack_from(body)
        stop = CHUNK.size + length
        self._write_chunk(body[:stop], [body[stop + _SIZE.size :]], indexed(records))

    def finish(self) -> None:
        """Write the open chunk, the summary and the footer."""
        self.close_chunk(least=0)
        self._put(record_bytes(DataEnd(self._crc)))
        start, self._crc = self._at, 0
        groups: list[tuple[Opcode, Iterable[bytes]]] = [
            (Opcode.SCHEMA, (record_bytes(d) for d in self._definitions if isinstance(d, Schema))),
            (
                Opcode.CHANNEL,
                (record_bytes(d) for d in self._definitions if isinstance(d, Channel)),
            ),
            (Opcode.STATISTICS, [record_bytes(self._statistics())]),
            (Opcode.CHUNK_INDEX, self._spooled()),
            (Opcode.METADATA_INDEX, map(record_bytes, self._metadata)),
        ]
        offsets = []
        for opcode, pieces in groups:
            group_start = self._at
            for piece in pieces:
                self._put(piece)
            if self._at > group_start:
                length = self._at - group_start
                offsets.append(record_bytes(SummaryOffset(opcode, group_start, length)))
        offsets_start = self._at
        self._put(b"".join(offsets))
        footer = record_bytes(
            Footer(summary_start=start, summary_offset_start=offsets_start, summary_crc=0)
        )
        crc = crc32(footer[:-4], self._crc)
        self._put(footer[:-4] + struct.pack("<I", crc) + MAGIC)

    def close(self) -> None:
        """Discard the index, whether the file was finished or not."""
        self._spool.close()

    def _put(self, *parts: Bytes) -> None:
        for part in parts:
            self._stream.write(part)
            self._crc = crc32(part, self._crc)
            self._at += len(part)

    def _write_chunk(self, head: Bytes, parts: Sequence[Bytes], content: OpenChunk) -> None:
        """Write a chunk and the index of its messages.

        Args:
            head: Its fields before the data.
            parts: The data, packed if they are.
        """
        start, size = self._at, sum(map(len, parts))
        prefix = PREFIX.pack(Opcode.CHUNK, len(head) + _SIZE.size + size)
        self._put(prefix, head, _SIZE.pack(size), *parts)
        index_start, offsets = self._at, b""
        for channel, entries in content.index.items():
            offsets += INDEX_OFFSET.pack(channel, self._at)
            self._counts[channel] += len(entries) // INDEX_ENTRY.size
            index = PREFIX.pack(Opcode.MESSAGE_INDEX, _INDEX_HEAD.size + len(entries))
            self._put(index + _INDEX_HEAD.pack(channel, len(entries)) + entries)
        first, last, unpacked, _, length = CHUNK.unpack_from(head)
        body = CHUNK_INDEX.pack(first, last, start, index_start - start, len(offsets)) + offsets
        body += _INDEX_SIZE.pack(self._at - index_start, length) + bytes(head[CHUNK.size :])
        body += _SIZE.pack(size) + _SIZE.pack(unpacked)
        self._spool.write(PREFIX.pack(Opcode.CHUNK_INDEX, len(body)) + body)
        self._n_chunks += 1
        if content.times:
            self._first = first if self._first is None else min(self._first, first)
            self._last = max(self._last, last)

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=0,
            channel_count=sum(isinstance(d, Channel) for d in self._definitions),
            channel_message_counts=dict(self._counts),
            chunk_count=self._n_chunks,
            message_count=self._counts.total(),
            metadata_count=len(self._metadata),
            message_start_time=self._first or 0,
            message_end_time=self._last,
            schema_count=sum(isinstance(d, Schema) for d in self._definitions),
        )

    def _spooled(self) -> Iterator[bytes]:
        self._spool.seek(0)
        while piece := self._spool.read(_SPOOLED):
            yield piece
