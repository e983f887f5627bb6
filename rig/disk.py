"""Durable writing, and reading of regular files of a limited size."""

import errno
import os
import secrets
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import BinaryIO

_REPLACED: ContextVar[frozenset[Path]] = ContextVar("_REPLACED", default=frozenset())
NEW = ".new"
"""File extension of what is being written."""
TEXT_LIMIT = 8_000_000
"""Largest size of a file of text that is read: rig, scene, table, manifest; bytes."""


def write_durably(path: Path, data: str | bytes, *, new: bool = False) -> None:
    """Write a file so that, whatever happens, it is complete: the old one or the new one.

    The data go to a file with a random name beside it, are flushed to the disk, and get their
    name at the end. A symbolic link at that name is replaced, not followed. A text keeps its line
    ends; an existing file's permissions are kept. What a killed process has left beside it is
    removed.

    Args:
        new: Whether to refuse an existing file, unless it may be replaced (`replacing`).

    Raises:
        OSError: It cannot be written, or exists already; then nothing has changed.
    """
    content = data.encode("utf-8") if isinstance(data, str) else data
    beside = path.with_name(f".{path.name}.{secrets.token_hex(4)}{NEW}")
    try:
        with beside.open("xb") as file:
            if not hold(file) or not beside.exists():  # another writer removed it before
                write_durably(path, data, new=new)
                return
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
            if os.name == "posix":  # while it is held: another writer removes what is not
                _give_name(beside, path, new)
        if os.name != "posix":
            _give_name(beside, path, new)
    except BaseException as error:
        beside.unlink(missing_ok=True)
        if isinstance(error, OSError):
            error.filename = str(path)  # and not the random name
        raise
    _remove_left(path)
    sync_folder(path.parent)


@contextmanager
def replacing(paths: Iterable[Path]) -> Iterator[None]:
    """Let new files take the names of these existing ones, in one step each, inside the context."""
    token = _REPLACED.set(frozenset(path.absolute() for path in paths))
    try:
        yield
    finally:
        _REPLACED.reset(token)


def may_replace(path: Path) -> bool:
    """Return whether a new file may take the name of an existing one."""
    return path.absolute() in _REPLACED.get()


def _give_name(beside: Path, path: Path, new: bool) -> None:
    if new and not may_replace(path):
        os.link(beside, path)  # unlike a rename, this fails if the file exists
        beside.unlink()
    else:
        if path.is_file():
            beside.chmod(stat.S_IMODE(path.stat().st_mode))
        beside.replace(path)


def _remove_left(path: Path) -> None:
    """Remove the files beside a file that nobody writes any more."""
    for name in os.listdir(path.parent):  # noqa: PTH208 (there may be thousands of others)
        if name.startswith(f".{path.name}.") and name.endswith(NEW):
            with suppress(OSError), path.with_name(name).open("rb") as file:
                if hold(file):
                    path.with_name(name).unlink()


def hold(file: BinaryIO) -> bool:
    """Mark an open file as in use until it is closed; return False if another process uses it.

    On Windows it always succeeds: there a file that is in use cannot be opened or renamed.
    """
    if os.name != "posix":
        return True
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return error.errno not in (errno.EAGAIN, errno.EACCES)
    return True


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


def make_folder(folder: Path) -> None:
    """Make a folder and those above it that are missing; their names are flushed to the disk.

    Raises:
        OSError: It cannot be made.
    """
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:
        raise FileExistsError(errno.EEXIST, "it is not a folder", str(folder)) from error
    for path in reversed(missing):
        sync_folder(path.parent)


def read_text(path: Path) -> str:
    """Return a text with its line ends unchanged; UTF-8, with or without a byte order mark.

    Raises:
        OSError: As of `read_limited`.
        UnicodeDecodeError: It is not UTF-8.
    """
    return read_limited(path).decode("utf-8-sig")


def why_unreadable(error: Exception) -> str:
    """Return the reason for a message that already names the file."""
    if isinstance(error, UnicodeDecodeError):
        return f"it is not a text in UTF-8 (byte {error.start + 1})"
    return getattr(error, "strerror", None) or str(error)


def read_limited(path: Path, most: int = TEXT_LIMIT) -> bytes:
    """Return the content of a regular file; a device, a pipe or a large file is not read.

    Args:
        most: Largest size, bytes.

    Raises:
        OSError: It cannot be read, is not a regular file, or is larger.
    """
    # Without O_NONBLOCK, opening a pipe that nobody writes to never returns.
    entry = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with os.fdopen(entry, "rb") as file:
        found = os.fstat(entry)
        if not stat.S_ISREG(found.st_mode):
            raise OSError(errno.EINVAL, "not a regular file", str(path))
        if found.st_size > most:
            text = f"larger than the limit of {most / 1e6:g} MB"
            raise OSError(errno.EFBIG, text, str(path))
        return file.read(most)
