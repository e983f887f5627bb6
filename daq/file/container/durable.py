"""Files that get their names only when they are complete and on the disk; those of MCAP records.

The library's own writer writes MCAP, within the limits that our readers have.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from mcap.records import Channel, Metadata, Schema
from mcap.writer import CompressionType, Writer

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.records import (
    COPY,
    LARGEST_CHUNK,
    LARGEST_DEFINITIONS,
    LIBRARY,
    crc32,
    record_bytes,
    with_checksum,
)
from sautereau.rig.disk import (
    give_name,
    hold,
    may_replace,
    refuse_name,
    sync_folder,
    why_unwritable,
)


def refuse_oversized(size: int) -> None:
    """Refuse a message of ``size`` bytes if it is larger than readers accept.

    Raises:
        RecordingError: It is.
    """
    if size + 64 * 1024 > LARGEST_CHUNK:  # With prefixes and definitions, besides its only message
        raise RecordingError(
            f"a message of {size} bytes exceeds the limit of {LARGEST_CHUNK} bytes that readers"
            " accept; split it"
        )


class McapWriter(Writer):
    """Writes one MCAP file of messages in chunks; `flush` closes the open chunk."""

    def __init__(self, stream: BinaryIO, *, compress: bool = True):
        """Prepare for an empty stream.

        Args:
            stream: Written sequentially, never read.
            compress: Whether to compress chunks with zstd.
        """
        super().__init__(
            stream,
            chunk_size=256 * 1024,  # bytes, uncompressed, at which a chunk is closed
            compression=CompressionType.ZSTD if compress else CompressionType.NONE,
            enable_data_crcs=True,  # the library's default leaves the end of the data unverified
        )
        # Sizes in bytes of Metadata by their checksums, since copies count once; under 0 that of
        # all schemas and channels.
        self._sizes: dict[int, int] = {}
        self._waiting = 0  # bytes of the definitions that the first message's chunk holds as well

    def begin(self, profile: str, definitions: Sequence[Schema | Channel]) -> None:
        """Write the header; the definitions go into the first chunk and the summary.

        Raises:
            ValueError: They are not numbered from 1 on.
        """
        self.start(profile, LIBRARY)
        for one in definitions:
            if isinstance(one, Schema):
                number = self.register_schema(one.name, one.encoding, one.data)
            else:
                number = self.register_channel(
                    one.topic, one.message_encoding, one.schema_id, one.metadata
                )
            if number != one.id:
                raise ValueError(f"number {one.id} where {number} is next")
        self._waiting = self._sizes[0] = sum(len(record_bytes(one)) for one in definitions)

    def add_metadata(self, name: str, data: dict[str, str], *, copy: bool = False) -> None:
        """Write a Metadata record with its own checksum immediately.

        Args:
            copy: Whether it repeats the record of this name.

        Raises:
            RecordingError: The different ones together are larger than readers accept.
        """
        if copy:
            super().add_metadata(name + COPY, with_checksum(name + COPY, data))
            return
        data = with_checksum(name, data)
        record = record_bytes(Metadata(name=name, metadata=data))
        self._sizes |= {crc32(record): len(record)}
        if (size := sum(self._sizes.values())) > LARGEST_DEFINITIONS:
            raise RecordingError(
                f"its definitions, with the {len(record)} bytes of the metadata {name}, have {size}"
                f" bytes, more than the limit of {LARGEST_DEFINITIONS}; shorten them"
            )
        super().add_metadata(name, data)

    def add_message(
        self, channel_id: int, log_time: int, data: bytes, publish_time: int, sequence: int = 0
    ) -> None:
        """Add a message to the open chunk; times are in ns since 1970.

        Raises:
            RecordingError: It is larger than readers accept.
        """
        refuse_oversized(self._waiting + len(data))
        if len(data) > LARGEST_CHUNK // 2:
            self.flush()  # the library closes a chunk only after the message that is too much
        super().add_message(channel_id, log_time, data, publish_time, sequence)
        self._waiting = 0


PART = ".part"  # Appended to the name of a recording until it is complete
FLUSH_PERIOD = 0.2
"""Time in s after which samples are flushed: a killed process loses at most this
and one block."""


class DurableFile:
    """A binary file written as ``name.part`` and renamed to ``name`` at the end."""

    def __init__(self, path: str | Path, *, ending: str = PART):
        """Open the unfinished file for writing.

        Args:
            ending: Appended to its name until it is complete. With `PART` an existing unfinished
                file is never replaced, since it may hold the only samples of a press. With
                another ending it is replaced: a killed program left it, and it was made from
                files that still exist.

        Raises:
            RecordingError: Either file exists already, or the folder cannot be written.
        """
        self.path = Path(path)
        self.part_path = self.path.with_name(self.path.name + ending)
        self.kept = ending == PART
        """Whether the unfinished file is kept after an error."""
        with self.writing():
            if not self.kept:
                self.part_path.unlink(missing_ok=True)
        for taken in (self.path, self.part_path):
            if os.path.lexists(taken) and not may_replace(taken):
                raise RecordingError(
                    f"recording {taken}: it exists and is never overwritten; move it away or"
                    " give another name"
                )
        if not self.path.parent.is_dir():
            raise RecordingError(
                f"recording {self.path}: there is no folder {self.path.parent}; create it first"
            )
        with self.writing():
            refuse_name(self.path)
            # The counts of a few channels, with all around them, are one write.
            self.stream: BinaryIO = self.part_path.open("xb", buffering=64 * 1024)
            self._named = False
            hold(self.stream)

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Turn an OSError into a RecordingError that says how to fix it."""
        try:
            yield
        except OSError as error:
            reason = why_unwritable(error)
            left = (
                f"; what was written before is in {self.part_path}: if it has samples, `sautereau"
                f" recover {self.part_path}` makes them readable"
            )
            raise RecordingError(
                f"recording {self.path}: cannot be written: {reason}"
                f"{'' if ';' in reason else '; check the disk'} and try"
                f" again{left * (self.kept and self.part_path.exists())}"
            ) from error

    def sync(self) -> None:
        """Flush everything written so far to the disk, and the first time the file's name."""
        with self.writing():
            self.stream.flush()
            os.fsync(self.stream.fileno())
            if not self._named:
                sync_folder(self.path.parent)
            self._named = True

    def close(self) -> None:
        """Flush everything to the disk and close the unfinished file."""
        with self.writing():
            try:
                self.sync()
            finally:
                self.stream.close()

    def abandon(self) -> None:
        """Close a file that can no longer be written; remove it if it is not `kept`."""
        with suppress(OSError):
            self.stream.close()
        with suppress(OSError):
            if not self.kept:
                self.part_path.unlink(missing_ok=True)

    def publish(self) -> None:
        """Rename a closed file to its final name."""
        with self.writing():
            try:
                give_name(self.part_path, self.path)
            except FileExistsError as error:
                here = f"; this recording is in {self.part_path}: rename that file" * self.kept
                raise RecordingError(
                    f"recording {self.path}: another program created it meanwhile, and it is not"
                    f" overwritten{here}"
                ) from error
            sync_folder(self.path.parent)

    @contextmanager
    def made(self) -> Iterator[BinaryIO]:
        """Yield the stream of a file that is made of others, which still exist.

        It gets its name at the end of the context; after an error it is removed.
        """
        try:
            with self.writing():
                yield self.stream
            self.close()
            self.publish()
        except BaseException:
            self.abandon()
            raise


class RecordingFile(DurableFile):
    """A `DurableFile` with MCAP records, which cannot be written after a fault."""

    def __init__(
        self, path: Path, *, compress: bool, seconds: Callable[[], float], ending: str = PART
    ):
        """Open the unfinished file.

        Args:
            compress: Whether to compress chunks with zstd.
            seconds: Time in s of a clock that is never set.
            ending: Appended to its name until it is finished; see `DurableFile`.
        """
        self.broken = False
        """Whether something could not be written completely."""
        super().__init__(path, ending=ending)
        self._writer = McapWriter(self.stream, compress=compress)
        self._seconds = seconds
        self._flushed = self._synced = seconds()

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Do as `DurableFile.writing`; an error while writing marks the file as broken."""
        if self.broken:
            raise RecordingError(
                f"recording {self.path}: an earlier fault truncated it; recover the content"
                f" of {self.part_path} with `sautereau recover`, and press again"
            )
        try:
            with super().writing():
                yield
        except RecordingError as error:
            self.broken |= isinstance(error.__cause__, OSError)
            raise
        except BaseException:
            self.broken = True
            raise

    @property
    def flush_due(self) -> bool:
        """Whether `FLUSH_PERIOD` has passed since the last flush."""
        return self._seconds() - self._flushed >= FLUSH_PERIOD

    def sync_if_due(self) -> None:
        """Sync everything written to the disk if a second has passed since the last time."""
        now = self._seconds()
        if now - self._synced >= 1.0:  # A power failure loses at most this second and one block
            self._synced = now
            self.sync()

    @contextmanager
    def flushing(self) -> Iterator[McapWriter]:
        """Yield the writer, then flush everything to the operating system."""
        self._flushed = self._seconds()
        with self.writing():
            yield self._writer
            self._writer.flush()

    def finish(self, end: dict[str, str]) -> None:
        """Complete the file, flush it to the disk and close it, still under its ``.part`` name."""
        try:
            with self.writing():
                self._writer.flush()
                self._writer.add_metadata("end", end)
                self._writer.finish()
            self.close()
        except BaseException:
            self.abandon()
            raise
