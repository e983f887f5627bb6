"""The records of a recording, all its checksums verified before or while they are read."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import BinaryIO

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.checksum import crc32
from sautereau.daq.file.container.records import MAGIC, PREFIX, DamageError, Record
from sautereau.daq.file.integrity import (
    PIECE,
    SKIPPED,
    check_data,
    check_summary,
    corrupted,
    data_crc,
    records,
    refuse_length,
)


def verified(file: BinaryIO) -> Iterator[Record]:
    """Yield the records of the data section, after verifying all checksums of the file."""
    end, _ = check_summary(file)
    check_data(file, end)
    yield from records(file, len(MAGIC), end)


@contextmanager
def verifying(file: BinaryIO) -> Iterator[Iterator[Record]]:
    """Yield the records of the data section, and verify all checksums by the end of the context.

    The file is read once. What is made of the records may be used only after the context.

    Raises:
        DamageError: A checksum does not match, also where that led to another error.
    """
    end, _ = check_summary(file)
    summed = _Summed(file, end)
    try:
        yield summed.records()
        summed.check()
    except RecordingError:
        check_data(file, end)
        raise


class _Summed:
    """The data section of a file, whose checksum is summed while its records are read."""

    def __init__(self, file: BinaryIO, end: int):
        self._file, self._end = file, end
        self._crc = 0

    def records(self) -> Iterator[Record]:
        """Yield the records; a thread reads and sums ahead of what the reader does with them."""
        batches = self._batches()
        if self._end < PIECE:
            for batch in batches:
                yield from batch
            return
        with ThreadPoolExecutor(1, "read ahead") as thread:
            future = thread.submit(next, batches, None)
            while batch := future.result():
                future = thread.submit(next, batches, None)
                yield from batch

    def _batches(self) -> Iterator[list[Record]]:
        """Yield the records in lists of about `PIECE` bytes."""
        file, at = self._file, len(MAGIC)
        file.seek(0)
        self._crc = crc32(file.read(at))
        batch, begin = list[Record](), at
        while at < self._end:
            prefix = file.read(PREFIX.size)
            opcode, length = PREFIX.unpack(prefix)
            at += PREFIX.size + length
            refuse_length(length, at > self._end)
            body = file.read(length)
            self._crc = crc32(body, crc32(prefix, self._crc))
            if opcode not in SKIPPED:
                batch.append(Record(opcode, body))
            if batch and (at - begin > PIECE or at == self._end):
                yield batch
                batch, begin = [], at

    def check(self) -> None:
        if self._crc != data_crc(self._file, self._end):
            raise DamageError(corrupted("its data"))
