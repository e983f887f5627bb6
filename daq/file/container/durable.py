"""A file that gets its name only when it is complete and on the disk."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from sautereau.daq.errors import RecordingError
from sautereau.rig.disk import sync_folder

PART = ".part"
"""Appended to the name of a recording until it is complete."""
_FULL = {
    errno.ENOSPC: "the disk is full; free some space",
    errno.EFBIG: "the file has reached the size that the system allows; raise the limit",
    getattr(errno, "EDQUOT", errno.ENOSPC): "the disk quota is used up; free some space",
}


class DurableFile:
    """A binary file written as ``name.part`` and renamed to ``name`` at the end."""

    def __init__(self, path: str | Path, *, ending: str = PART):
        """Open the unfinished file for writing.

        Args:
            path: Path of the finished file.
            ending: Appended to its name until then.

        Raises:
            RecordingError: Either file exists already, or the folder cannot be written.
        """
        self.path = Path(path)
        self.part_path = self.path.with_name(self.path.name + ending)
        for taken in (self.path, self.part_path):
            if os.path.lexists(taken):
                raise RecordingError(
                    f"recording {taken}: it exists and is never overwritten; move it away or"
                    " give another name"
                )
        if not self.path.parent.is_dir():
            raise RecordingError(
                f"recording {self.path}: there is no folder {self.path.parent}; create it first"
            )
        with self.writing():
            self.stream: BinaryIO = self.part_path.open("xb")

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Turn an OSError into a RecordingError that says how to fix it."""
        try:
            yield
        except OSError as error:
            code = error.errno
            reason = _FULL.get(code) if code is not None else None
            left = (
                f"; what was written before is in {self.part_path}, which `sautereau recover"
                f" {self.part_path}` makes readable"
            )
            raise RecordingError(
                f"recording {self.path}: cannot be written:"
                f" {reason or f'{error.strerror or error}; check the disk'} and try"
                f" again{left * self.part_path.exists()}"
            ) from error

    def sync(self) -> None:
        """Flush everything written so far to the disk."""
        with self.writing():
            self.stream.flush()
            os.fsync(self.stream.fileno())

    def close(self) -> None:
        """Flush everything to the disk and close the unfinished file."""
        with self.writing():
            try:
                self.sync()
            finally:
                self.stream.close()

    def abandon(self) -> None:
        """Close a file that cannot be written any further; its content so far is kept."""
        with suppress(OSError):
            self.stream.close()

    def publish(self) -> None:
        """Rename a closed file to its final name."""
        if os.path.lexists(self.path):
            raise RecordingError(
                f"recording {self.path}: another program created it meanwhile, and it is not"
                f" overwritten; this recording is in {self.part_path}: rename that file"
            )
        with self.writing():
            self.part_path.rename(self.path)
            sync_folder(self.path.parent)
