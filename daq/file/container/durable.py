"""A file that takes its name only when it is whole and on the disk."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from sautereau.daq.errors import RecordingError
from sautereau.rig.disk import sync_folder

PART = ".part"
"""Follows the name of a recording until it is whole."""
_FULL = {
    errno.ENOSPC: "the disk is full; free some space",
    errno.EFBIG: "the file has reached the size that the system allows; raise the limit",
    getattr(errno, "EDQUOT", errno.ENOSPC): "the disk quota is used up; free some space",
}


class DurableFile:
    """A binary file written beside its name, as ``name.part``, and renamed at the end."""

    def __init__(self, path: str | Path, *, beside: str = PART):
        """Open the file beside ``path`` for writing.

        Args:
            path: Of the finished file.
            beside: What its name is followed by until then.

        Raises:
            RecordingError: Either name is taken, or the folder cannot be written.
        """
        self.path = Path(path)
        self.part_path = self.path.with_name(self.path.name + beside)
        for taken in (self.path, self.part_path):
            if os.path.lexists(taken):
                raise RecordingError(
                    f"recording {taken}: it exists and is never overwritten; move it away or"
                    " give another name"
                )
        if not self.path.parent.is_dir():
            raise RecordingError(
                f"recording {self.path}: there is no folder {self.path.parent}; make it first"
            )
        with self.writing():
            self.stream: BinaryIO = self.part_path.open("xb")

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Turn an OSError into a RecordingError with the remedy."""
        try:
            yield
        except OSError as error:
            code = error.errno
            reason = _FULL.get(code) if code is not None else None
            left = (
                f"; what was written is left in {self.part_path}, and `sautereau recover"
                f" {self.part_path}` makes it readable"
            )
            raise RecordingError(
                f"recording {self.path}: cannot be written:"
                f" {reason or f'{error.strerror or error}; see to the disk'} and try"
                f" again{left * self.part_path.exists()}"
            ) from error

    def sync(self) -> None:
        """Put on the disk what was written so far."""
        with self.writing():
            self.stream.flush()
            os.fsync(self.stream.fileno())

    def close(self) -> None:
        """Put everything on the disk, under the name it has beside its own."""
        with self.writing():
            try:
                self.sync()
            finally:
                self.stream.close()

    def abandon(self) -> None:
        """Close a file that cannot be written any further; what it holds already stays."""
        with suppress(OSError):
            self.stream.close()

    def publish(self) -> None:
        """Give a closed file its name."""
        if os.path.lexists(self.path):
            raise RecordingError(
                f"recording {self.path}: it came into being meanwhile and is not overwritten;"
                f" this one is in {self.part_path}: give that another name"
            )
        with self.writing():
            self.part_path.rename(self.path)
            sync_folder(self.path.parent)
