"""Unpack and verify the chunks of an MCAP file, or search a damaged file for them."""

import mmap
import re
import struct
import threading
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from io import BufferedReader

import lz4.frame
import zstandard

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.records import (
    COPY,
    CRC_KEY,
    LARGEST_CHUNK,
    LARGEST_DEFINITIONS,
    PREFIX,
    UNAVAILABLE,
    Bytes,
    DamageError,
    Opcode,
    Record,
    crc32,
    read_metadata,
)
from sautereau.rig.units import shown

AHEAD = 3  # Number of chunks unpacked ahead of their reader; it bounds the memory
MOST_UNPACKED = 500
"""Limit of the unpacked size, in multiples of the file's size; a file of zeros reaches 300."""
Unpacked = tuple[int, Bytes]  # Opcode and body of a record
ZSTD, LZ4 = b"zstd", b"lz4"  # Names of compressions; sautereau writes zstd or none
CHUNK = struct.Struct("<QQQII")
"""Start, end, size, CRC, length of the compression's name, which follows."""
_SIZE = struct.Struct("<Q")
NAMES = ("channels", "rig", "software", "session", "schemas", "end", "recovered")
"""Names of a recording's Metadata records, without the end of those that are repeated."""
_RECORD = re.compile(
    # A chunk: opcode, a length below 2**32, times, sizes and a CRC, the name of its compression.
    rb"\x06.{4}\0{4}.{28}(?:\x04\0\0\0zstd|\x03\0\0\0lz4|\0{4})"
    # A Metadata record: opcode, a length below 2**32, its name.
    + rb"|\x0c.{4}\0{4}(?:"
    + b"|".join(
        re.escape(struct.pack("<I", len(n)) + n.encode())
        for name in NAMES
        for n in (name, name + COPY)
    )
    + rb")",
    re.DOTALL,
)


class _OfThread(threading.local):
    """The context of zstd of each thread: making it takes an eighth of the time of a press."""

    def __init__(self) -> None:
        self.unpack = zstandard.ZstdDecompressor().decompress


_OF_THREAD = _OfThread()


def unpacked(records: Iterable[Record]) -> Iterator[Unpacked]:
    """Yield opcode and body of records in their order; a chunk's body unpacked and verified.

    Threads unpack compressed chunks ahead of their reader: zstd and CRC release Python's lock.

    Raises:
        DamageError: As `unpack_chunk`.
    """
    waiting: deque[tuple[int, Bytes | Future[Bytes]]] = deque()
    chunks = 0
    with ThreadPoolExecutor(AHEAD - 1, "recording") as threads:
        for opcode, body in records:
            packed = opcode == Opcode.CHUNK and body[CHUNK.size : CHUNK.size + len(ZSTD)] == ZSTD
            chunks += packed
            ahead = packed and chunks > 8  # As many as of a press are unpacked without threads
            if not ahead and not waiting:
                yield _ready(opcode, body)
                continue
            body = bytes(body)  # its place is reused for the next record
            waiting.append((opcode, threads.submit(unpack_chunk, body) if ahead else body))
            if len(waiting) > AHEAD:
                yield _ready(*waiting.popleft())
        while waiting:
            yield _ready(*waiting.popleft())


def _ready(opcode: int, body: "Bytes | Future[Bytes]") -> Unpacked:
    if isinstance(body, Future):
        return opcode, body.result()
    return opcode, unpack_chunk(body) if opcode == Opcode.CHUNK else body


def unpack_chunk(body: Bytes) -> Bytes:
    """Return the records of a chunk, unpacked, after its checksum, if it has one, was verified.

    Raises:
        DamageError: The checksum does not match, or a length is invalid.
        RecordingError: It is larger than `LARGEST_CHUNK`, or its compression is unknown.
    """
    if len(body) < CHUNK.size:
        raise DamageError(f"a chunk of {len(body)} bytes is too short")
    _, _, size, crc, name_length = CHUNK.unpack_from(body)
    at = CHUNK.size + name_length
    if size > LARGEST_CHUNK:
        raise RecordingError(
            f"a chunk of {size} bytes exceeds the limit of {LARGEST_CHUNK} bytes; write it again"
            " with smaller chunks, `mcap compress --chunk-size 1000000`"
        )
    compression = bytes(body[CHUNK.size : at])
    packed = memoryview(body)[at + _SIZE.size :]
    if len(body) < at + _SIZE.size or _SIZE.unpack_from(body, at)[0] != len(packed):
        raise DamageError("a chunk's length is not that of its content")
    if compression == ZSTD:
        data = _unzstd(packed, size)
    elif compression == LZ4:
        data = _unlz4(packed, size)
    elif compression == b"":
        data = packed
    else:
        name = shown(compression.decode(errors="backslashreplace"))
        raise RecordingError(
            f"a chunk has the compression {name}, not zstd, lz4 or none; convert it with `mcap"
            " compress --compression zstd`"
        )
    if len(data) != size or (crc != UNAVAILABLE and crc32(data) != crc):
        raise DamageError("the checksum of a chunk does not match")
    return data


def _unzstd(packed: memoryview, size: int) -> bytes:
    """Unpack one zstd frame; the size that the frame itself gives allocates no memory."""
    try:
        if zstandard.frame_content_size(packed) not in (size, -1):  # -1: written as a stream
            raise DamageError("a chunk's content has another size than its record says")
        return _OF_THREAD.unpack(packed, max_output_size=max(1, size))
    except zstandard.ZstdError as error:
        raise DamageError(f"a chunk cannot be unpacked: {error}") from error


def _unlz4(packed: memoryview, size: int) -> bytes:
    """Unpack one lz4 frame, at most one byte more than its record says."""
    unpacker = lz4.frame.LZ4FrameDecompressor()
    try:
        data = unpacker.decompress(packed, max_length=size + 1)
    except (RuntimeError, EOFError) as error:
        raise DamageError(f"a chunk cannot be unpacked: {error}") from error
    if not unpacker.eof:
        raise DamageError("a chunk's content has another size than its record says")
    return data


def find_intact(file: BufferedReader, *opcodes: Opcode) -> Iterator[Record]:
    """Yield all chunks and Metadata records whose own checksums match, in their order.

    Every offset is searched for the pattern of their first bytes, so that a wrong length cannot
    hide the records after it. A chunk without a checksum is not known to be intact.

    Args:
        file: Searched completely.
        opcodes: Kinds of the records; none for both.

    Raises:
        RecordingError: The file has so many overlapping false starts of records that verifying
            them would read more than `MOST_UNPACKED` times its size.
    """
    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        require_checksum = data.find(CRC_KEY, 0, 1024**2) >= 0  # The first Metadata records
        at, left = 0, max(4 * LARGEST_CHUNK, MOST_UNPACKED * len(data))
        while match := _RECORD.search(data, at):
            start = match.start()
            opcode, length = PREFIX.unpack_from(data, start)
            stop = start + PREFIX.size + length
            most = LARGEST_CHUNK if opcode == Opcode.CHUNK else LARGEST_DEFINITIONS
            at = start + 1
            if length > most or stop > len(data) or (opcodes and opcode not in opcodes):
                continue
            left -= length + (_claimed(data, start, length) if opcode == Opcode.CHUNK else 0)
            if left < 0:
                raise RecordingError(
                    "verifying everything in it that looks like a record would read more than"
                    f" MOST_UNPACKED = {MOST_UNPACKED} times its size; use a copy of it"
                )
            body = data[start + PREFIX.size : stop]
            if _is_intact(opcode, body, require_checksum):
                yield Record(opcode, body)
                at = stop


def _claimed(data: mmap.mmap, start: int, length: int) -> int:
    """Return the unpacked size in a chunk's head; 0 if `unpack_chunk` refuses the chunk at once."""
    if length < CHUNK.size:
        return 0
    size = CHUNK.unpack_from(data, start + PREFIX.size)[2]
    return size if size <= LARGEST_CHUNK else 0


def _is_intact(opcode: int, body: bytes, require_checksum: bool) -> bool:
    try:
        if opcode == Opcode.CHUNK:
            unpack_chunk(body)
            return has_checksum(body)
        read_metadata(body, require_checksum=require_checksum)
    except RecordingError:
        return False
    return True


def has_checksum(chunk: Bytes) -> bool:
    """Return whether a chunk has a checksum; one that is too short is refused when it is read."""
    return len(chunk) < CHUNK.size or CHUNK.unpack_from(chunk)[3] != UNAVAILABLE
