"""Find what is still whole in a damaged recording."""

import mmap
import re
import struct
from collections.abc import Iterator
from typing import BinaryIO

from sautereau.daq.file.container.records import (
    LARGEST_CHUNK,
    LARGEST_DEFINITIONS,
    PREFIX,
    SEAL,
    DamageError,
    Opcode,
    Record,
    unpack_chunk,
    unsealed,
)

NAMES = ("channels", "rig", "software", "session", "schemas", "end", "recovered")
"""Metadata records that a recording has."""
_HEAD = 1024**2  # bytes in which the seals of a head are to be found
_RECORD = re.compile(
    # A chunk: opcode, a length below 2**32, times, sizes and a CRC, the name of its compression.
    rb"\x06.{4}\0{4}.{28}(?:\x04\0\0\0zstd|\0{4})"
    # A Metadata record: opcode, a length below 2**32, its name.
    + rb"|\x0c.{4}\0{4}(?:"
    + b"|".join(re.escape(struct.pack("<I", len(n)) + n.encode()) for n in NAMES)
    + rb")",
    re.DOTALL,
)


def find_whole(file: BinaryIO) -> Iterator[Record]:
    """Yield all chunks and Metadata records whose own checksums hold, in their order.

    They are looked for by what their first bytes look like, wherever they may stand, so
    that no length that is wrong can hide those that follow.
    """
    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        has_seals = data.find(SEAL, 0, _HEAD) >= 0
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
            if _is_whole(opcode, body, has_seals):
                yield Record(opcode, body)
                at = stop


def _is_whole(opcode: int, body: bytes, has_seals: bool) -> bool:
    try:
        if opcode == Opcode.CHUNK:
            unpack_chunk(body)
        else:
            unsealed(body, has_seal=has_seals)
    except DamageError:
        return False
    return True
