"""Parse the records of an MCAP file within limits, and verify the checksums that they hold."""

import struct
from collections.abc import Container, Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import McapRecord, Metadata
from mcap.writer import LIBRARY_IDENTIFIER
from mcap.writer import MCAP0_MAGIC as MAGIC

from sautereau.daq.errors import RecordingError

try:
    from isal.isal_zlib import crc32  # 13 times as fast as zlib's
except ImportError:  # no wheel for this processor
    from zlib import crc32

__all__ = ["MAGIC", "Opcode", "crc32"]

LIBRARY = f"sautereau; {LIBRARY_IDENTIFIER}"
"""Library in the header of a file that `McapWriter` wrote: all its checksums are available."""
COPY = " (copy)"
"""At the end of the name of a repeated Metadata record: viewers want names that are unique."""
LARGEST_CHUNK = 32 * 1024**2  # Limit in bytes for any record and any unpacked chunk
UNAVAILABLE = 0  # Any checksum that MCAP's records do not have
LARGEST_DEFINITIONS = 4 * 1024**2
"""Limit in bytes for all Metadata, Channel and Schema records of a file together."""

PREFIX = struct.Struct("<BQ")  # Opcode and length of a record
MESSAGE = struct.Struct("<HIQQ")  # Channel, sequence, log time and publish time of a message, ns
CHUNK_INDEX = struct.Struct("<QQQQI")
"""Start, end, offset and length of a chunk, size of the offsets, which follow."""
INDEX_OFFSET = struct.Struct("<HQ")  # Channel, and offset of its MessageIndex
_NUMBER = struct.Struct("<H")
_LENGTH = struct.Struct("<I")
CHANNEL = struct.Struct("<HH")  # Number of a channel and of its schema
_HEAD = PREFIX.size + _NUMBER.size
_CRC = "crc32"
CRC_KEY = _CRC.encode()  # Bytes that the Metadata records of a recording with checksums contain


Bytes = bytes | bytearray | memoryview


class DamageError(RecordingError):
    """A recording whose bytes are no longer those written."""


class Record(NamedTuple):
    """One record of the data section."""

    opcode: int
    body: Bytes


def records_within(
    chunk: Bytes, counted: Container[int] = ()
) -> Iterator[tuple[int, memoryview, int]]:
    """Yield opcode, body and number of the records of an unpacked chunk.

    Args:
        counted: Channels whose messages are only counted: consecutive ones of equal length are
            yielded as the first of them, with their number.
    """
    view, at = memoryview(chunk), 0
    while at < len(view):
        opcode, length = PREFIX.unpack_from(view, at)
        size = PREFIX.size + length
        if opcode == 0:
            raise ValueError("a record has the invalid opcode 0")
        if size > len(view) - at:
            raise ValueError(f"a record of {length} bytes reaches beyond its chunk")
        body = view[at + PREFIX.size : at + size]
        alike = opcode == Opcode.MESSAGE and _NUMBER.unpack_from(body)[0] in counted
        n = _run_length(chunk, at, size) if alike else 1
        yield opcode, body, n
        at += n * size


def _run_length(chunk: Bytes, at: int, size: int) -> int:
    """Return how many consecutive records share opcode, length and channel, or fewer."""
    # At most 256, which bounds the work per record if the runs are short.
    n = min(256, (len(chunk) - at) // size)
    # The first and the last 8 bytes of each head: numbers are compared faster than texts.
    heads = np.ndarray((n, 2), "<u8", chunk, at, (size, _HEAD - 8))
    return int((heads != heads[0]).argmax()) // 2 or n


def record_bytes(record: McapRecord) -> bytes:
    """Return the bytes of a record, prefix included."""
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


def text_within(body: bytes, at: int) -> tuple[str, int]:
    """Return a text that follows its length, and the offset where it ends.

    Raises:
        ValueError: It reaches beyond the record, or is not UTF-8.
    """
    begin = at + _LENGTH.size
    end = begin + _LENGTH.unpack_from(body, at)[0]
    if end > len(body):
        raise ValueError(f"a text of {end - begin} bytes reaches beyond its record")
    return body[begin:end].decode(), end


def texts_within(body: bytes, at: int) -> dict[str, str]:
    """Return texts by name, which follow their total length.

    Raises:
        ValueError: As `text_within`.
    """
    texts = {}
    end = at + _LENGTH.size + _LENGTH.unpack_from(body, at)[0]
    at += _LENGTH.size
    while at < end:
        name, at = text_within(body, at)
        texts[name], at = text_within(body, at)
    return texts


@lru_cache(maxsize=64)
def read_channel(body: bytes) -> tuple[int, str, dict[str, str]]:
    """Return number, topic and metadata of a Channel record; the last ones are kept, as below.

    Raises:
        ValueError, struct.error: It is invalid.
    """
    topic, at = text_within(body, CHANNEL.size)
    _, at = text_within(body, at)  # encoding of its messages
    return CHANNEL.unpack_from(body)[0], topic, texts_within(body, at)


def with_checksum(name: str, data: dict[str, str]) -> dict[str, str]:
    """Return the entries of a Metadata record with a checksum, since MCAP gives it none."""
    return data | {_CRC: f"{_checksum(name, data):08x}"}


@lru_cache(maxsize=32)
def read_metadata(body: bytes, *, require_checksum: bool = False) -> Metadata:
    """Return a Metadata record without its checksum, after that has been verified.

    A repeated record has the name of the first.

    The last records are kept: a file repeats them, and most are the same in all files of a session.

    Args:
        require_checksum: Whether to refuse a record without a checksum; version 0.1 wrote none.

    Raises:
        DamageError: The checksum does not match, or the record is invalid.
    """
    try:
        name, at = text_within(body, 0)
        texts = texts_within(body, at)
    except (ValueError, struct.error) as error:
        raise DamageError(f"a Metadata record cannot be read: {error}") from error
    checksum = texts.pop(_CRC, None)
    given = checksum is not None or require_checksum
    if given and checksum != f"{_checksum(name, texts):08x}":
        raise DamageError(f"the checksum of the metadata {name} does not match")
    return Metadata(name.removesuffix(COPY), texts)


def _checksum(name: str, data: dict[str, str]) -> int:
    """Return the CRC of a Metadata record, prefix included."""
    return crc32(record_bytes(Metadata(name, data)))
