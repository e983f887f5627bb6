"""Chunks unpacked ahead of their reader, by threads, for zstd and CRC leave Python alone."""

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor

from sautereau.daq.file.container.records import Opcode, Record, unpack_chunk

AHEAD = 3
"""Chunks at a time, which bounds the memory."""
FEW = 8
"""Chunks, the first of a file, for which no thread is worth its start; a press has no more."""


def unpacked(records: Iterable[Record]) -> Iterator[Record]:
    """Yield records in their order, the body of each chunk unpacked and verified.

    Raises:
        DamageError: As `sautereau.daq.file.container.records.unpack_chunk`.
    """
    waiting: deque[tuple[int, bytes | Future[bytes]]] = deque()
    chunks = 0
    with ThreadPoolExecutor(AHEAD - 1, "recording") as threads:
        for opcode, body in records:
            chunks += opcode == Opcode.CHUNK
            ahead = opcode == Opcode.CHUNK and chunks > FEW
            waiting.append((opcode, threads.submit(unpack_chunk, body) if ahead else body))
            if len(waiting) > AHEAD:
                yield _ready(*waiting.popleft())
        while waiting:
            yield _ready(*waiting.popleft())


def _ready(opcode: int, body: "bytes | Future[bytes]") -> Record:
    if isinstance(body, Future):
        return Record(opcode, body.result())
    return Record(opcode, unpack_chunk(body) if opcode == Opcode.CHUNK else body)
