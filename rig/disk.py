"""Text and names that are on the disk when the call returns."""

import os
from pathlib import Path


def write_through(path: Path, text: str, *, new: bool) -> None:
    """Write a file and put it on the disk, line ends as they are in the text.

    Args:
        path: Of the file.
        text: All of it.
        new: Whether the file must not exist yet.

    Raises:
        OSError: It cannot be written, or exists though it must not.
    """
    with path.open("x" if new else "w", encoding="utf-8", newline="") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Put the names in a folder on the disk, where the system lets that be asked for.

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
