"""Verification of a recording's checksums before anything of it is used."""

import os
import struct
from collections.abc import Container, Iterator
from contextlib import contextmanager, suppress
from io import BufferedReader
from pathlib import Path
from typing import NamedTuple

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.records import (
    CHUNK_INDEX,
    COPY,
    INDEX_OFFSET,
    LARGEST_CHUNK,
    LARGEST_DEFINITIONS,
    LIBRARY,
    MAGIC,
    PREFIX,
    UNAVAILABLE,
    DamageError,
    Opcode,
    Record,
    crc32,
    text_within,
)
from sautereau.daq.file.provenance import HEAD, PROFILE
from sautereau.rig.disk import kind_of, open_regular

_FOOTER = struct.Struct("<BQQQI")  # prefix, summary start, summary offset start, CRC
_DATA_END = struct.Struct("<BQI")  # prefix, CRC of all before
_CRC_SIZE = 4
_SIZE = struct.Struct("<Q")
PIECE = 128 * 1024
"""Bytes read at a time. A longer record is read as one piece: it is then still in the processor's
cache when it is used."""
FOREIGN = "another program has changed it: use the file as sautereau wrote it"
"""End of messages about content that sautereau never writes."""
USED = (Opcode.CHUNK, Opcode.MESSAGE, Opcode.CHANNEL, Opcode.METADATA)
"""Records that readers use; MCAP has others, and programs may add their own."""
EVERY_CHANNEL = frozenset(range(2**16))  # All numbers that MCAP channels can have


class IndexedChunk(NamedTuple):
    """Position of a chunk."""

    start: int
    """First byte in the file."""
    stop: int
    """Byte after the last."""
    last: int
    """Latest log time in it, ns since 1970."""
    channels: frozenset[int]
    """Numbers of the MCAP channels that have messages in it."""


@contextmanager
def opened(path: Path, *, damaged: bool = False) -> Iterator[BufferedReader]:
    """Open a recording for reading; every error in the context names the file.

    Args:
        damaged: Whether to accept it even if its first bytes are not those of a recording.

    Raises:
        RecordingError: The file does not exist, cannot be read, or is not from sautereau.
    """
    try:
        try:
            if path.is_dir():
                raise RecordingError("it is a folder; give one of the .mcap files in it")
            with open_regular(path) as file:
                if not damaged:
                    check_header(file, kind_of(path))
                yield file
        except FileNotFoundError as error:
            raise RecordingError("no such file; check its name and folder") from error
        except OSError as error:
            raise RecordingError(
                f"it cannot be read: {error.strerror or error}; check its permissions and disk"
            ) from error
    except DamageError as error:
        raise DamageError(
            f"recording {path}: {error}; use a copy of it, or recover the undamaged part with"
            f" `sautereau recover {path}`"
        ) from error
    except RecordingError as error:
        raise RecordingError(f"recording {path}: {error}") from error.__cause__


class Section:
    """Reads consecutive records of a file through one buffer, and sums their bytes."""

    def __init__(self, file: BufferedReader, start: int, end: int):
        """Start at an offset of the file; ``end`` is the offset of the byte after the last."""
        self._file, self._left, self._start = file, end - start, start
        self._buffer = memoryview(bytearray(min(PIECE, end - start)))
        self._at = self._stop = 0  # range of unread bytes in the buffer
        self.crc = 0
        """Checksum of all bytes read so far."""

    def records(self, skip: int = 0, used: Container[int] = USED) -> Iterator[Record]:
        """Yield the records of the opcodes ``used`` that follow ``skip`` bytes.

        The body of a record is valid until the next one is requested.

        Raises:
            RecordingError: A length is invalid.
        """
        self._file.seek(self._start)
        self._need(skip)
        self._at += skip
        while self._at < self._stop or self._left:
            self._need(PREFIX.size)
            opcode, length = PREFIX.unpack_from(self._buffer, self._at)
            if opcode in used:
                self._need(PREFIX.size + length)
                begin = self._at + PREFIX.size
                self._at = begin + length
                yield Record(opcode, self._buffer[begin : self._at])
            else:
                self._pass(PREFIX.size + length)

    def _pass(self, n: int) -> None:
        """Read and drop ``n`` bytes."""
        self._within(n)
        while n > 0:
            self._need(piece := min(n, PIECE))
            self._at += piece
            n -= piece

    def _within(self, n: int) -> None:
        if n > self._stop - self._at + self._left:
            raise RecordingError(f"a record of {n} bytes reaches beyond its section; {FOREIGN}")

    def _need(self, n: int) -> None:
        """Fill the buffer until it holds ``n`` unread bytes."""
        held = self._stop - self._at
        if held >= n:
            return
        self._within(n)
        if n > LARGEST_CHUNK:
            raise RecordingError(
                f"a record of {n} bytes exceeds the limit of {LARGEST_CHUNK} bytes; {FOREIGN}"
            )
        rest = self._buffer[self._at : self._stop]
        stop = min(max(n + 8 * 1024, PIECE), held + self._left)  # And the index of its messages
        if stop > len(self._buffer):
            self._buffer = memoryview(bytearray(stop))
        self._buffer[:held] = rest
        read = self._file.readinto(self._buffer[held:stop])
        self._at, self._stop, self._left = 0, held + read, self._left - read
        self.crc = crc32(self._buffer[held : self._stop], self.crc)
        if self._stop < n:
            raise DamageError("it was truncated while it was read")


def verified(file: BufferedReader) -> Iterator[Record]:
    """Yield the records of the data section, after verifying all checksums of the file.

    Metadata that follow messages come first, and again in their place. The body of a record is
    valid until the next one is requested.
    """
    end, _ = check_summary(file)
    check_data(file, end)
    yield from _in_order(file, Section(file, 0, end), end)


@contextmanager
def verifying(file: BufferedReader) -> Iterator[Iterator[Record]]:
    """Yield the records as `verified` does, and verify all checksums by the end of the context.

    The file is read once. The body of a record is valid until the next one is requested; what is
    made of the records may be used only after the context.

    Raises:
        DamageError: A checksum does not match, also where that led to another error.
    """
    end, _ = check_summary(file)
    data = Section(file, 0, end)
    try:
        yield _in_order(file, data, end)
        check_data(file, end, data.crc)
    except RecordingError:
        check_data(file, end)
        raise


def _in_order(file: BufferedReader, data: Section, end: int) -> Iterator[Record]:
    first, late = head(file, end)
    yield from first if late else ()
    yield from data.records(len(MAGIC))


def check_summary(file: BufferedReader) -> tuple[int, int]:
    """Refuse a truncated file, or one whose summary has changed.

    Returns:
        Offsets in bytes of the end of the data section and of the start of the summary.

    Raises:
        DamageError: Says what is wrong.
    """
    size = size_of(file)
    at = size - len(MAGIC) - _FOOTER.size
    file.seek(max(0, at))
    end = file.read()
    if at < len(MAGIC) or not end.endswith(MAGIC):
        raise DamageError(_truncated(size))
    opcode, length, summary, _, crc = _FOOTER.unpack_from(end)
    if opcode != Opcode.FOOTER or length != _FOOTER.size - PREFIX.size:
        raise DamageError(_truncated(size))
    summary = summary or at  # 0: there is none
    if not len(MAGIC) + _DATA_END.size <= summary <= at:
        raise DamageError(corrupted("its footer"))
    if available(file, crc) and _checksum(file, summary, size - len(MAGIC) - _CRC_SIZE) != crc:
        raise DamageError(corrupted("its summary"))
    return summary - _DATA_END.size, summary


def check_data(file: BufferedReader, end: int, crc: int | None = None) -> None:
    """Refuse a file whose data section has changed.

    Args:
        end: Offset of the end of the section, bytes.
        crc: Checksum of the section; None to compute it.

    Raises:
        DamageError: It is not the one in the file, if that has one.
    """
    file.seek(end)
    opcode, length, expected = _DATA_END.unpack(file.read(_DATA_END.size))
    if opcode != Opcode.DATA_END or length != _CRC_SIZE:
        raise DamageError(corrupted("its data"))
    if not available(file, expected):
        return
    if (_checksum(file, 0, end) if crc is None else crc) != expected:
        raise DamageError(corrupted("its data"))


def has_data_crc(file: BufferedReader) -> bool:
    """Return whether a file, which is not truncated, has a checksum of its data section."""
    file.seek(check_summary(file)[0])
    return _DATA_END.unpack(file.read(_DATA_END.size))[2] != UNAVAILABLE


def available(file: BufferedReader, crc: int) -> bool:
    """Return whether a checksum of data or summary is one; all are in a file of `McapWriter`."""
    if crc != UNAVAILABLE:
        return True
    file.seek(len(MAGIC))
    head = file.read(PREFIX.size + 3 * _CRC_SIZE + len(PROFILE) + len(LIBRARY))
    try:
        _, at = text_within(head, PREFIX.size)  # profile
        return text_within(head, at)[0] == LIBRARY
    except (ValueError, struct.error):
        return False  # it is longer


def indexed(file: BufferedReader) -> tuple[list[Record], list[IndexedChunk]]:
    """Return the definitions of a file and the positions of its chunks, as its summary has them.

    The data section counts as one chunk if the summary does not describe all of it: messages may
    be outside chunks, and the index of chunks, of their messages or of channels may be missing.

    Raises:
        DamageError: The checksum of the summary does not match.
    """
    data_end, summary = check_summary(file)
    everything = IndexedChunk(len(MAGIC), data_end, 2**64, EVERY_CHANNEL)
    footer = size_of(file) - len(MAGIC) - _FOOTER.size
    definitions, _ = head(file, data_end)
    n_metadata, found, after = len(definitions), list[IndexedChunk](), None
    used = (Opcode.CHANNEL, Opcode.CHUNK_INDEX)
    for opcode, body in Section(file, summary, footer).records(used=used):
        if opcode == Opcode.CHANNEL:
            definitions.append(Record(opcode, bytes(body)))
            continue
        try:
            _, end, at, length, size = CHUNK_INDEX.unpack_from(body)
            stop = CHUNK_INDEX.size + size
            offsets = INDEX_OFFSET.iter_unpack(body[CHUNK_INDEX.size : stop])
            (index,) = _SIZE.unpack_from(body, stop)
        except struct.error as error:
            raise RecordingError(f"a record of its index is too short; {FOREIGN}") from error
        channels = frozenset(channel for channel, _ in offsets)
        if not channels or after not in (None, at):
            return definitions, [everything]
        after = at + length + index
        found.append(IndexedChunk(at, min(data_end, at + length), end, channels))
    described = found and len(definitions) > n_metadata
    return definitions, found if described else [everything]


def head(file: BufferedReader, end: int) -> tuple[list[Record], bool]:
    """Return the Metadata records up to the last of `HEAD`, and whether messages precede it.

    Other programs write them anywhere; sautereau writes them first.

    Args:
        end: Offset of the end of the data section, bytes.
    """
    found, missing, late, size = list[Record](), set(HEAD), False, 0
    at = len(MAGIC)
    while missing and at + PREFIX.size <= end and size <= LARGEST_DEFINITIONS:
        file.seek(at)
        opcode, length = PREFIX.unpack(file.read(PREFIX.size))
        if opcode == Opcode.METADATA and length <= LARGEST_DEFINITIONS:
            body = file.read(length)
            found.append(Record(opcode, body))
            size += length
            with suppress(ValueError, struct.error):  # it is refused when it is read
                missing.discard(text_within(body, 0)[0].removesuffix(COPY))
        late |= opcode in (Opcode.CHUNK, Opcode.MESSAGE)
        at += PREFIX.size + length
    return found, late


def check_header(file: BufferedReader, kind: str = "") -> None:
    """Refuse a file that does not start with MCAP's magic bytes and sautereau's header.

    Args:
        kind: What its name says that it is (`sautereau.rig.disk.kind_of`).
    """
    file.seek(0)
    head = file.read(len(MAGIC) + PREFIX.size + _CRC_SIZE + len(PROFILE))
    if not head:
        raise RecordingError("it is empty: nothing was recorded; delete it and press again")
    if not head.startswith(MAGIC):
        if MAGIC.startswith(head):
            raise DamageError(_truncated(len(head)))
        if kind and kind != "a recording":
            raise RecordingError(
                f"it is {kind}; give a recording made by sautereau, or a folder of them"
            )
        raise RecordingError(
            "it is not an MCAP file; give a recording made by sautereau, or search the file for"
            " one with `sautereau recover`"
        )
    opcode, profile = head[len(MAGIC) : len(MAGIC) + 1], head[len(MAGIC) + PREFIX.size :]
    expected = struct.pack("<I", len(PROFILE)) + PROFILE.encode("ascii")
    if opcode not in (b"", bytes([Opcode.HEADER])) or not expected.startswith(profile):
        raise RecordingError(
            "it is an MCAP file, but its header does not name sautereau; give another file, or"
            " use `sautereau recover` if only the header may be damaged"
        )


def size_of(file: BufferedReader) -> int:
    """Return the size of an open file in bytes."""
    return os.fstat(file.fileno()).st_size


def _checksum(file: BufferedReader, start: int, stop: int) -> int:
    """Return the CRC of the bytes between two offsets, read piece by piece."""
    file.seek(start)
    crc = 0
    while start < stop and (piece := file.read(min(PIECE, stop - start))):
        crc = crc32(piece, crc)
        start += len(piece)
    return crc


def _truncated(size: int) -> str:
    return f"it is truncated: {size} bytes without an end, as after a crash or on a full disk"


def corrupted(where: str) -> str:
    """Return the text of a wrong checksum."""
    return f"it is corrupted: the checksum of {where} does not match"
