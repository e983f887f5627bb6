"""Durable writing: text and file names are on the disk when the call returns."""

import os
from pathlib import Path


def write_through(path: Path, text: str, *, new: bool) -> None:
    """Write a file and flush it to the disk, with the line ends of the text.

    Args:
        path: File to write.
        text: Complete text.
        new: Whether to refuse an existing file.

    Raises:
        OSError: It cannot be written, or exists already.
    """
    with path.open("x" if new else "w", encoding="utf-8", newline="") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Flush the file names of a folder to the disk, on systems that support it.

    Raises:
        OSError: The disk refuses.
    """
    if os.name != "posix":
        return
    entry = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(entry)
    finally:
        os.close(entry)
