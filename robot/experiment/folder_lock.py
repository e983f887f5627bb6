"""One session at a time in a folder."""

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path

from sautereau.rig.disk import make_folder
from sautereau.robot.errors import RobotError

LOCK = ".session.lock"
"""Locked by the operating system while a session runs, and free again when its process ends,
however it ends; the file itself stays."""
OWNER = ".session.owner"
"""Names the process that holds the lock."""


@contextmanager
def only_session(folder: Path) -> Iterator[None]:
    """Hold a folder for one session; it is created, and removed again if nothing is written.

    Raises:
        RobotError: Another session runs in it, or the folder cannot be written.
    """
    from filelock import FileLock, Timeout

    created = not folder.exists()
    try:
        make_folder(folder)
        lock = FileLock(folder / LOCK, timeout=0, is_singleton=False)
        lock.acquire()
    except Timeout as error:
        owner = "another process"
        with suppress(OSError):
            owner = (folder / OWNER).read_text(encoding="utf-8")[:200].strip()
        raise RobotError(
            f"session folder {folder}: {owner} runs a session in it; wait until it has ended, or"
            " give another --out"
        ) from error
    except OSError as error:
        raise RobotError(
            f"session folder {folder}: {error.strerror}; give a folder that can be written"
        ) from error
    try:
        started = datetime.now().astimezone().isoformat(timespec="seconds")
        owner = f"process {os.getpid()} on {platform.node()}, since {started}"
        with suppress(OSError):  # the name is only for a message
            (folder / OWNER).write_text(owner, encoding="utf-8")
        yield
    finally:
        with suppress(OSError):
            (folder / OWNER).unlink(missing_ok=True)
        lock.release()
        if created and {path.name for path in folder.iterdir()} <= {LOCK}:
            (folder / LOCK).unlink(missing_ok=True)
            folder.rmdir()
