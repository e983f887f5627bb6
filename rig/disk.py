"""The one way out and the one way in: durable writing, limited reading, files of the package."""

import csv
import difflib
import errno
import hashlib
import os
import re
import secrets
import stat
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from importlib import resources
from io import BufferedReader, FileIO
from pathlib import Path
from typing import Any, BinaryIO, TextIO

from sautereau.rig.errors import SautereauError

_REPLACED: ContextVar[frozenset[Path]] = ContextVar("_REPLACED", default=frozenset())
_NOT_REGULAR = "not a regular file"
NEW = ".new"  # File extension of what is being written
TEXT_LIMIT = 8_000_000
"""Largest size of a file of text that is read: rig, scene, table, manifest; bytes."""
_NO_LINKS = (errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK, errno.EINVAL)
"""Of `os.link` on disks without hard links: exFAT, FAT, and some network and user file systems."""
_NO_SYNC = (errno.EINVAL, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EBADF, errno.EISDIR)
"""Of `os.fsync` of a folder, on file systems that flush their names on their own."""
_HELD = 2**31 - 2
"""Last place of a byte that `msvcrt.locking` can lock: what is locked, others cannot read."""
_NO_NAME = re.compile(
    r'[<>:"|?*\x00-\x1f]|[. ]$|^(con|prn|aux|nul|(com|lpt)[1-9¹²³]|con(in|out)\$) *(\.|$)', re.I
)
"""Names that Windows gives no file: to a device, to a stream of another file, or changed."""
_BYTE = re.compile("[\udc80-\udcff]")  # A byte that is not UTF-8, as Python holds it in a text
_FULL = {
    errno.ENOSPC: "the disk is full; free some space",
    errno.EFBIG: "the file has reached the size that the system allows; raise the limit",
    getattr(errno, "EDQUOT", errno.ENOSPC): "the disk quota is used up; free some space",
}


@contextmanager
def new_file(path: Path, *, replace: bool = False) -> Iterator[BinaryIO]:
    """Yield a binary file to write; whatever happens, its name has complete content or the old one.

    The data go to a file with a random name beside it, are flushed to the disk, and get their
    name when the block ends without an error; after an error the file is removed. A symbolic link
    at that name is replaced, not followed. An existing file's permissions are kept. What a killed
    process has left beside it is removed.

    Args:
        replace: Whether to replace an existing file also outside `replacing`.

    Raises:
        OSError: It cannot be written, or exists already; then nothing has changed.
    """
    refuse_name(path)
    replace = replace or may_replace(path)
    if not replace and os.path.lexists(path):
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path))
    try:
        file = _beside(path)
    except OSError as error:
        raise _named(error, path) from error
    beside = Path(file.name)
    try:
        with file:
            yield file
            file.flush()
            os.fsync(file.fileno())
            if os.name == "posix":  # while it is held: another writer removes what is not
                give_name(beside, path, replace=replace)
        if os.name != "posix":
            give_name(beside, path, replace=replace)
    except BaseException as error:
        with suppress(OSError):
            beside.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno and error.filename in (None, str(beside)):
            raise _named(error, path) from error
        raise
    remove_left(path)
    sync_folder(path.parent)


def write_durably(path: Path, data: str | bytes, *, replace: bool = False) -> None:
    """Write a file as `new_file` does; a text keeps its line ends.

    Raises:
        OSError: It cannot be written, or exists already; then nothing has changed.
    """
    with new_file(path, replace=replace) as file:
        file.write(data.encode("utf-8") if isinstance(data, str) else data)


@contextmanager
def replacing(paths: Iterable[Path]) -> Iterator[None]:
    """Let new files take the names of these existing ones, in one step each, inside the context.

    Inside another such context its files may be replaced, too.
    """
    token = _REPLACED.set(_REPLACED.get().union(path.absolute() for path in paths))
    try:
        yield
    finally:
        _REPLACED.reset(token)


def may_replace(path: Path) -> bool:
    """Return whether a new file may take the name of an existing one."""
    return path.absolute() in _REPLACED.get()


def give_name(beside: Path, path: Path, *, replace: bool = False) -> None:
    """Give a file that is complete and flushed its name.

    On disks without hard links, a file that another program creates in the same moment is
    replaced.

    Raises:
        OSError: A file of that name exists, and neither ``replace`` nor `replacing` permits that.
            Or another program has one of them open, in Windows.
    """
    replace = replace or may_replace(path)
    # In Windows a scanner for viruses may have opened a file that was just closed.
    for wait in (0.05, 0.1, 0.2, 0.4) if os.name == "nt" else ():
        try:
            return _rename(beside, path, replace)
        except PermissionError:
            time.sleep(wait)
    return _rename(beside, path, replace)


def _rename(beside: Path, path: Path, replace: bool) -> None:
    if replace:
        if path.is_file() and os.name == "posix":  # elsewhere a mode says only "read-only"
            beside.chmod(stat.S_IMODE(path.stat().st_mode))
        beside.replace(path)
        return
    if os.name == "nt":
        beside.rename(path)  # there this fails if the file exists
        return
    try:
        os.link(beside, path)  # unlike a rename, this fails if the file exists
    except OSError as error:
        if error.errno not in _NO_LINKS:
            raise
        if os.path.lexists(path):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path)) from error
        beside.rename(path)
    else:
        beside.unlink()


_SEAL = b"<!-- written by sautereau, SHA-256 of all above: %s -->\n"


def sealed(page: str) -> bytes:
    """Return an HTML page with a last line by which `unchanged` knows it."""
    content = page.encode()
    return content + _SEAL % hashlib.sha256(content).hexdigest().encode()


def unchanged(path: Path) -> bool:
    """Return whether a file is a page of `sealed` that nobody has changed since."""
    try:
        with open_regular(path) as file:
            content = file.read()
    except OSError:
        return False
    page = content[: -len(_SEAL % bytes(64))]
    return content == page + _SEAL % hashlib.sha256(page).hexdigest().encode()


def _beside(path: Path) -> BinaryIO:
    """Return a new file with a random name beside ``path``, which is held until it is closed."""
    while True:
        file = path.with_name(f"{_prefix(path)}{secrets.token_hex(4)}{NEW}").open("x+b")
        if hold(file) and os.path.lexists(file.name):
            return file
        file.close()  # another writer removed it before it was held


def _prefix(path: Path) -> str:
    """Return how the names of the files beside one begin: hidden, and within a system's limit."""
    name = os.fsencode(path.name)
    return f".{hashlib.sha256(name).hexdigest()[:32] if len(name) > 240 else path.name}."


def _named(error: OSError, path: Path) -> OSError:
    """Return an error about ``path``: not about the random name beside it, nor about no file."""
    return type(error)(error.errno, why_unwritable(error), str(path))


def remove_left(path: Path) -> None:
    """Remove the files beside a file that nobody writes any more."""
    for name in os.listdir(path.parent):  # noqa: PTH208 (there may be thousands of others)
        if name.startswith(_prefix(path)) and name.endswith(NEW):
            with suppress(OSError):
                with path.with_name(name).open("rb") as file:
                    if (unused := hold(file)) and os.name == "posix":
                        path.with_name(name).unlink()
                if unused:  # in Windows an open file cannot be removed
                    path.with_name(name).unlink(missing_ok=True)


def hold(file: BinaryIO) -> bool:
    """Mark an open file as in use until it is closed; return False if another process uses it."""
    entry = file.fileno()
    try:
        if os.name == "posix":
            import fcntl

            fcntl.flock(entry, fcntl.LOCK_EX | fcntl.LOCK_NB)
        else:
            import msvcrt

            place = os.lseek(entry, 0, os.SEEK_CUR)
            os.lseek(entry, _HELD, os.SEEK_SET)
            try:
                msvcrt.locking(entry, msvcrt.LK_NBLCK, 1)
            finally:
                os.lseek(entry, place, os.SEEK_SET)
    except OSError as error:
        return error.errno not in (errno.EAGAIN, errno.EACCES)
    return True


def refuse_name(path: Path) -> None:
    """Refuse a path with a name that Windows gives no file, where this is Windows.

    Raises:
        OSError: A device, a stream, or a name that Windows changes, such as ``nul`` or ``a.``.
    """
    if os.name != "nt":
        return
    for name in path.parts[bool(path.anchor) :]:
        if name != ".." and _NO_NAME.search(name):
            reason = f"Windows has no file called {name!r}; give another name"
            raise OSError(errno.EINVAL, reason, str(path))


def sync_folder(folder: Path) -> None:
    """Flush the file names of a folder to the disk, on systems that support it.

    Raises:
        OSError: The disk refuses.
    """
    if os.name != "posix":
        return
    try:
        entry = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(entry)
        finally:
            os.close(entry)
    except OSError as error:
        if error.errno not in _NO_SYNC:
            raise _named(error, folder.absolute()) from error


def need_open_files(count: int = 64) -> None:
    """Raise this process's limit of open files to a number, where it is lower.

    Without files gRPC aborts the process, or answers nothing.

    Raises:
        SautereauError: The system does not allow so many.
    """
    try:
        import resource
    except ImportError:  # Windows
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < count:
        raise SautereauError(
            f"the system allows this process {hard} open files, and the acquisition needs {count};"
            f" raise the limit with `ulimit -n {count}`, or in a new terminal"
        )
    if soft < count:
        resource.setrlimit(resource.RLIMIT_NOFILE, (count, hard))


def make_folder(folder: Path) -> None:
    """Make a folder and those above it that are missing; their names are flushed to the disk.

    Raises:
        OSError: It cannot be made.
    """
    refuse_name(folder)
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        for path in reversed(missing):  # `parents=True` calls itself for each of them
            path.mkdir(exist_ok=True)
        folder.mkdir(exist_ok=True)
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


@contextmanager
def explained(error_type: type[Exception], what: str, fix: str) -> Iterator[None]:
    """Report a file that cannot be read or written in the block: what, the reason, how to fix it.

    Raises:
        Exception: An ``error_type``.
    """
    try:
        yield
    except (OSError, UnicodeDecodeError) as error:
        raise error_type(f"{what}: {why_unreadable(error)}; {fix}") from error


def why_unreadable(error: Exception) -> str:
    """Return the reason for a message that already names the file."""
    if isinstance(error, UnicodeDecodeError):
        return f"it is not a text in UTF-8 (byte {error.start + 1})"
    name = error.filename if os.name == "nt" and isinstance(error, FileNotFoundError) else None
    if name and (size := len(str(Path(name).absolute()))) > 247:
        return (
            f"its path has {size} characters, and Windows takes 259, of a folder 247, unless its"
            " setting LongPathsEnabled is 1; give a shorter one"
        )
    return getattr(error, "strerror", None) or str(error)


def why_unwritable(error: OSError) -> str:
    """Return the reason for a message that already names the file, and how to fix it if known."""
    full = _FULL.get(error.errno) if error.errno is not None else None
    return full or why_unreadable(error)


def as_text(text: str | Path) -> str:
    """Return a text or a path as UTF-8 can store it, with escapes for what it cannot express.

    Bytes of another encoding, which Python holds as surrogates, are ``\\xff``.
    """
    named = _BYTE.sub(lambda byte: f"\\x{ord(byte[0]) - 0xDC00:02x}", os.fspath(text))
    return named.encode(errors="backslashreplace").decode()


def open_regular(path: Path) -> BufferedReader:
    """Open a regular file to read it; a device or a pipe is refused.

    Raises:
        OSError: It cannot be opened, or is not a regular file.
    """
    return BufferedReader(_Named(_regular(path, os.O_RDONLY | getattr(os, "O_BINARY", 0)), path))


class _Named(FileIO):
    """A file to read, whose errors name it: those of the system do so only where it is opened."""

    def __init__(self, entry: int, path: Path):
        super().__init__(entry, "rb")
        self._path = path

    def readinto(self, buffer: Any) -> int:
        try:
            return super().readinto(buffer)
        except OSError as error:
            raise _named(error, self._path) from error

    def readall(self) -> bytes:
        try:
            return super().readall()
        except OSError as error:
            raise _named(error, self._path) from error

    def close(self) -> None:
        with suppress(OSError):  # nothing is lost of what was read
            super().close()


def open_to_append(path: Path) -> TextIO:
    """Open a regular file, or a new one, to append text; a device or a pipe is refused.

    Raises:
        OSError: It cannot be written, or is not a regular file.
    """
    entry = _regular(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    return os.fdopen(entry, "a", encoding="utf-8", errors="backslashreplace")


def _regular(path: Path, flags: int) -> int:
    # Without O_NONBLOCK, opening a pipe that nobody writes to, or reads, never returns.
    try:
        entry = os.open(path, flags | getattr(os, "O_NONBLOCK", 0), 0o666)
    except ValueError as error:  # NUL in the path, or characters that no file name can have
        raise OSError(errno.EINVAL, f"not the name of a file: {error}", str(path)) from error
    except OSError as error:
        if error.errno != errno.ENXIO:  # of a pipe that nobody reads
            raise
        raise OSError(errno.EINVAL, _NOT_REGULAR, str(path)) from error
    if not stat.S_ISREG(os.fstat(entry).st_mode):
        os.close(entry)
        raise OSError(errno.EINVAL, _NOT_REGULAR, str(path))
    return entry


def digest(path: Path) -> str:
    """Return the SHA-256 of a regular file of any size, in hexadecimal.

    Raises:
        OSError: As of `open_regular`.
    """
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def read_limited(path: Path, most: int = TEXT_LIMIT) -> bytes:
    """Return the content of a regular file; a device, a pipe or a large file is not read.

    Args:
        most: Largest size, bytes.

    Raises:
        OSError: It cannot be read, is not a regular file, or is larger.
    """
    with open_regular(path) as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise OSError(errno.EFBIG, f"larger than the limit of {most / 1e6:g} MB", str(path))
    return content


_KINDS = {
    (".toml",): "a rig or scene file",
    (".mcap", ".part"): "a recording",
    (".json",): "a JSON file",
    (".csv", ".tdms", ".wav", ".mat", ".h5", ".hdf5", ".npz", ".parquet"): (
        "a table or another program's file, which `sautereau import` reads"
    ),
    (".png", ".svg", ".pdf", ".jpg", ".webp", ".html"): "a picture or page",
}
"""What files with these extensions are."""


def kind_of(path: Path) -> str:
    """Return what a path is, by its name alone, as messages say it; empty if that says nothing."""
    if path.is_dir():
        return "a folder"
    ending = path.suffix.lower()
    return next((kind for endings, kind in _KINDS.items() if ending in endings), "")


def named_text(
    name: str | Path, package: str, what: str, error_type: type[Exception]
) -> tuple[str, str, Path]:
    """Read a TOML file.

    Args:
        name: Path of a file, or name of a packaged one.

    Returns:
        The text, the name of the file for messages, and its folder.
    """
    path = Path(name)
    try:
        other = kind_of(path) if path.suffix != ".toml" and path.exists() else ""
        if path.suffix == ".toml" or (path.is_file() and not other):
            return read_text(path), str(path), path.parent
    except (OSError, ValueError) as error:  # not UTF-8, or an impossible file name
        raise error_type(
            f"{what} file {path}: cannot be read: {why_unreadable(error)}; give the path"
            " of a UTF-8 text file"
        ) from error
    packaged = resources.files(package).joinpath(f"{name}.toml")
    if not packaged.is_file():
        if other:
            raise error_type(f"{what} {str(name)!r} is {other}; give the path of a .toml file")
        known = packaged_names(package)
        close = difflib.get_close_matches(str(name), known, n=1)
        meant = f"did you mean {close[0]!r}? If not, " if close else ""
        raise error_type(
            f"{what} {str(name)!r} is neither a file nor a packaged {what} ({', '.join(known)});"
            f" {meant}give the path of a .toml file"
        )
    return packaged.read_text(encoding="utf-8"), f"packaged {what} {name}", Path()


def packaged_names(package: str) -> list[str]:
    """Return the names of the TOML files in a package."""
    files = resources.files(package).iterdir()
    return sorted(file.name[:-5] for file in files if file.name.endswith(".toml"))


def table_beside(module: str | Path) -> list[list[str]]:
    """Return the rows below the head of ``NAME.csv``, for the `__file__` ``NAME.py``."""
    with Path(module).with_suffix(".csv").open(encoding="utf-8", newline="") as file:
        return list(csv.reader(file))[1:]
