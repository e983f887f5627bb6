"""Chunks unpacked ahead of their reader, by threads, for zstd and CRC leave Python alone."""

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor

from daq.file.records import Opcode, Record, unpack_chunk

AHEAD = 3
"""Chunks at a time, which bounds the memory."""


def unpacked(records: Iterable[Record]) -> Iterator[Record]:
    """Yield records in their order, the body of each chunk unpacked and verified.

    Raises:
        DamageError: As `daq.file.records.unpack_chunk`.
    """
    waiting: deque[tuple[int, bytes | Future[bytes]]] = deque()
    with ThreadPoolExecutor(AHEAD - 1, "recording") as threads:
        for opcode, body in records:
            is_chunk = opcode == Opcode.CHUNK
            waiting.append((opcode, threads.submit(unpack_chunk, body) if is_chunk else body))
            if len(waiting) > AHEAD:
                yield _ready(*waiting.popleft())
        while waiting:
            yield _ready(*waiting.popleft())


def _ready(opcode: int, body: "bytes | Future[bytes]") -> Record:
    return Record(opcode, body if isinstance(body, bytes) else body.result())
