"""Locks that one process holds at a time, each with a text that names the process."""

import hashlib
import os
import platform
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from datetime import datetime
from pathlib import Path

from sautereau.rig.disk import read_limited, write_durably

_SHARED: dict[Path, int | None] = {}
"""Locks of this process that a thread may take once more: that thread; None while it has."""


class Taken(Exception):  # noqa: N818 - the name states what happened
    """Another process or thread holds the lock; the text names it."""


@contextmanager
def locked(path: Path, purpose: str = "", *, shared: bool = False) -> Iterator[None]:
    """Hold a lock in the block; the operating system frees it when the process ends, however.

    Beside the lock's file, one with the extension `.owner` names this process. Both are removed at
    the end; a killed process leaves them.

    Args:
        path: File of the lock.
        purpose: Why this process holds it, for the message of another.
        shared: Whether the same thread may take the lock once more in the block.

    Raises:
        Taken: Another process, or thread of this one, holds it.
        OSError: The file cannot be written.
    """
    from filelock import FileLock, Timeout

    me = threading.get_ident()
    if _SHARED.get(path) == me:
        _SHARED[path] = None
        try:
            yield
        finally:
            _SHARED[path] = me
        return
    owner = path.with_suffix(".owner")
    lock = FileLock(path, timeout=0, is_singleton=False, thread_local=False)
    try:
        lock.acquire()
    except Timeout as error:
        raise Taken(_named(owner)) from error
    try:
        since = datetime.now().astimezone().isoformat(timespec="seconds")
        name = f"process {os.getpid()} on {platform.node()}, since {since}"
        name += f", for {purpose}" * bool(purpose)
        with suppress(OSError):  # the name is only for a message
            write_durably(owner, name.encode("utf-8", "backslashreplace"), replace=True)
        if shared:
            _SHARED[path] = me
        yield
    finally:
        _SHARED.pop(path, None)
        for file in (owner, path):
            with suppress(OSError):  # of Windows, where `release` removes it
                file.unlink(missing_ok=True)  # who waits for a removed lock takes a new one
        with suppress(OSError):  # the file that it locks is gone; the end of the process frees it
            lock.release()


def device_lock(*names: str) -> Path:
    """Return the file of the lock on a device of this machine, for the processes of this user.

    Args:
        names: Name the device: its kind, address and name.

    Raises:
        OSError: The folder of the locks cannot be made.
    """
    from platformdirs import user_cache_path

    folder = user_cache_path("sautereau", ensure_exists=True)
    # The folder may be on a disk that other machines use as well.
    key = hashlib.sha256(" ".join((platform.node(), *names)).encode()).hexdigest()[:16]
    return folder / f"{names[0]}-{key}.lock"


@contextmanager
def held_device(
    error_type: type[Exception], who: str, purpose: str, *names: str, shared: bool = False
) -> Iterator[None]:
    """Hold a device of this machine in the block; see `locked`.

    Args:
        error_type: Raised where another process or thread holds it; the message names both.
        who: Name of the device in that message.
        names: Kind and name of the device, see `device_lock`.
    """
    with ExitStack() as stack:
        try:
            stack.enter_context(locked(device_lock(*names), purpose, shared=shared))
        except Taken as error:
            raise error_type(
                f"{who}: another program uses it: end that program, or wait until it has ended:"
                f" {error}"
            ) from error
        except OSError as error:
            raise error_type(
                f"{who}: {error.filename}: {error.strerror}; give this user a folder for its cache"
                " (XDG_CACHE_HOME) that can be written"
            ) from error
        yield


def _named(owner: Path) -> str:
    """Return the name of the process that holds a lock."""
    try:
        # A longer text would not be this program's.
        text = read_limited(owner, 1000).decode("utf-8", "replace").strip()
    except OSError:
        text = ""
    return text or "another process"
