"""Search a damaged recording for chunks and Metadata records whose checksums match."""

import mmap
import re
import struct
from collections.abc import Iterator
from typing import BinaryIO

from sautereau.daq.file.container.chunks import unpack_chunk
from sautereau.daq.file.container.records import (
    CRC_KEY,
    LARGEST_CHUNK,
    LARGEST_DEFINITIONS,
    PREFIX,
    DamageError,
    Opcode,
    Record,
    read_metadata,
)

NAMES = ("channels", "rig", "software", "session", "schemas", "end", "recovered")
"""Names of a recording's Metadata records."""
_HEAD = 1024**2  # bytes at the start of a file that hold its first Metadata records
_RECORD = re.compile(
    # A chunk: opcode, a length below 2**32, times, sizes and a CRC, the name of its compression.
    rb"\x06.{4}\0{4}.{28}(?:\x04\0\0\0zstd|\0{4})"
    # A Metadata record: opcode, a length below 2**32, its name.
    + rb"|\x0c.{4}\0{4}(?:"
    + b"|".join(re.escape(struct.pack("<I", len(n)) + n.encode()) for n in NAMES)
    + rb")",
    re.DOTALL,
)


def find_intact(file: BinaryIO) -> Iterator[Record]:
    """Yield all chunks and Metadata records whose own checksums match, in their order.

    They are searched by the pattern of their first bytes at every offset, so that a wrong length
    cannot hide the records after it.
    """
    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        require_checksum = data.find(CRC_KEY, 0, _HEAD) >= 0
        at = 0
        while match := _RECORD.search(data, at):
            start = match.start()
            opcode, length = PREFIX.unpack_from(data, start)
            stop = start + PREFIX.size + length
            most = LARGEST_CHUNK if opcode == Opcode.CHUNK else LARGEST_DEFINITIONS
            at = start + 1
            if length > most or stop > len(data):
                continue
            body = data[start + PREFIX.size : stop]
            if _is_intact(opcode, body, require_checksum):
                yield Record(opcode, body)
                at = stop


def _is_intact(opcode: int, body: bytes, require_checksum: bool) -> bool:
    try:
        if opcode == Opcode.CHUNK:
            unpack_chunk(body)
        else:
            read_metadata(body, require_checksum=require_checksum)
    except DamageError:
        return False
    return True
