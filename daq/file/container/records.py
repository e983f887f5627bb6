"""The records of an MCAP file, taken apart within limits and with their checksums."""

import struct
import zlib
from collections.abc import Container, Iterator
from functools import lru_cache
from io import BytesIO
from typing import NamedTuple

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import McapRecord, Metadata
from mcap.writer import MCAP0_MAGIC as MAGIC

from sautereau.daq.errors import RecordingError

__all__ = ["MAGIC", "Opcode"]

CHUNK_SIZE = 256 * 1024
"""Bytes, uncompressed, at which a chunk is closed."""
LARGEST_CHUNK = 32 * 1024**2
"""Bytes, of any one record and of any one chunk unpacked."""
LARGEST_DEFINITIONS = 4 * 1024**2
"""Bytes, of all Metadata, Channel and Schema records of a file together."""

PREFIX = struct.Struct("<BQ")
"""Opcode and length of a record."""
MESSAGE = struct.Struct("<HIQQ")
"""Channel, sequence, log time and publish time of a message, ns."""
_CHUNK = struct.Struct("<QQQII")  # start, end, size, CRC, length of the compression's name
_SIZE = struct.Struct("<Q")
_NUMBER = struct.Struct("<H")
_LENGTH = struct.Struct("<I")
CHANNEL = struct.Struct("<HH")
"""Number of a channel and of its schema."""
_LONGEST_RUN = 512
_CRC = "crc32"
SEAL = _CRC.encode()
"""What the Metadata records of a recording with checksums contain."""


class DamageError(RecordingError):
    """A recording whose bytes are no more what was written."""


class Record(NamedTuple):
    """One record of the data section."""

    opcode: int
    body: bytes


def unpack_chunk(body: bytes) -> bytes:
    """Return the records of a chunk, unpacked, once its checksum has held.

    Raises:
        DamageError: The checksum fails, or a length has no sense or exceeds
            `LARGEST_CHUNK`.
    """
    if len(body) < _CHUNK.size:
        raise DamageError(f"a chunk of {len(body)} bytes is too short to be one")
    _, _, size, crc, named = _CHUNK.unpack_from(body)
    at = _CHUNK.size + named
    if size > LARGEST_CHUNK:
        raise DamageError(f"a chunk of {size} bytes exceeds the limit of {LARGEST_CHUNK} bytes")
    compression = body[_CHUNK.size : at]
    packed = memoryview(body)[at + _SIZE.size :]
    if len(body) < at + _SIZE.size or _SIZE.unpack_from(body, at)[0] != len(packed):
        raise DamageError("a chunk's length is not that of its content")
    if compression == b"zstd":
        data = _unzstd(packed, size)
    elif compression == b"":
        data = bytes(packed)
    else:
        raise DamageError(f"a chunk is compressed by {compression!r}, neither zstd nor not at all")
    if len(data) != size or zlib.crc32(data) != crc:
        raise DamageError("the checksum of a chunk does not match")
    return data


def _unzstd(packed: memoryview, size: int) -> bytes:
    """Unpack one zstd frame; what it says of its own size is believed by no allocation."""
    try:
        if zstandard.frame_content_size(packed) != size:
            raise DamageError("a chunk's content has another size than its record says")
        return zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
    except zstandard.ZstdError as error:
        raise DamageError(f"a chunk cannot be unpacked: {error}") from error


def records_within(
    chunk: bytes, counted: Container[int] = ()
) -> Iterator[tuple[int, memoryview, int]]:
    """Yield opcode, body and number of the records of an unpacked chunk.

    Args:
        chunk: Its records.
        counted: Channels whose messages are not of interest one by one: of those that are
            alike in length and follow each other, the first stands for all.
    """
    view, at = memoryview(chunk), 0
    while at < len(view):
        opcode, length = PREFIX.unpack_from(view, at)
        size = PREFIX.size + length
        if opcode == 0:
            raise ValueError("a record has the opcode 0, which means none")
        if size > len(view) - at:
            raise ValueError(f"a record of {length} bytes reaches beyond its chunk")
        body = view[at + PREFIX.size : at + size]
        alike = opcode == Opcode.MESSAGE and _NUMBER.unpack_from(body)[0] in counted
        n = _run_length(chunk, at, size) if alike else 1
        yield opcode, body, n
        at += n * size


def _run_length(chunk: bytes, at: int, size: int) -> int:
    """Return how many records of one opcode, length and channel follow each other, or fewer."""
    n = min(_LONGEST_RUN, (len(chunk) - at) // size)
    heads = np.frombuffer(chunk, _head_of(size), n, at)
    other = np.zeros(n, bool)
    for name in ("opcode", "length", "channel"):
        other |= heads[name] != heads[name][0]
    return int(other.argmax()) or n


@lru_cache(16)
def _head_of(size: int) -> np.dtype:
    """Return the type of a message record of so many bytes, as far as its channel."""
    return np.dtype(
        {
            "names": ["opcode", "length", "channel"],
            "formats": ["u1", "<u8", "<u2"],
            "offsets": [0, 1, PREFIX.size],
            "itemsize": size,
        }
    )


def written(record: McapRecord) -> bytes:
    """Return the bytes of a record, prefix included."""
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


def text_within(body: bytes, at: int) -> tuple[str, int]:
    """Return a text that its length stands before, and where it ends.

    Raises:
        ValueError: It reaches beyond the record, or is no text.
    """
    begin = at + _LENGTH.size
    end = begin + _LENGTH.unpack_from(body, at)[0]
    if end > len(body):
        raise ValueError(f"a text of {end - begin} bytes reaches beyond its record")
    return body[begin:end].decode(), end


def texts_within(body: bytes, at: int) -> dict[str, str]:
    """Return texts by name, whose length altogether stands before them.

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


def stream_of(body: bytes | memoryview) -> ReadDataStream:
    """Return a record's body for the library's own readers."""
    return ReadDataStream(BytesIO(body))


def sealed(name: str, data: dict[str, str]) -> dict[str, str]:
    """Return what a Metadata record says with its own checksum, which MCAP has not."""
    return data | {_CRC: f"{_checksum(name, data):08x}"}


def unsealed(body: bytes, *, has_seal: bool = False) -> Metadata:
    """Return a Metadata record without its checksum, once that has held.

    Args:
        body: Of the record.
        has_seal: Refuse one without a checksum; else it is taken to be of a recording made
            before there were any.

    Raises:
        DamageError: The checksum fails, or the record makes no sense.
    """
    try:
        name, at = text_within(body, 0)
        texts = texts_within(body, at)
    except (ValueError, struct.error) as error:
        raise DamageError(f"a Metadata record cannot be read: {error}") from error
    told = texts.pop(_CRC, None)
    if told is None and not has_seal:
        return Metadata(name, texts)
    if told != f"{_checksum(name, texts):08x}":
        raise DamageError(f"the checksum of the metadata {name} does not match")
    return Metadata(name, texts)


def _checksum(name: str, data: dict[str, str]) -> int:
    """Return the CRC of a Metadata record, prefix included."""
    packed = [_packed(text) for pair in data.items() for text in pair]
    content = b"".join(packed)
    body = _packed(name) + _LENGTH.pack(len(content)) + content
    return zlib.crc32(PREFIX.pack(Opcode.METADATA, len(body)) + body)


def _packed(text: str) -> bytes:
    data = text.encode()
    return _LENGTH.pack(len(data)) + data
