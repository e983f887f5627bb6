"""What a power cut leaves of a folder.

A process notes every change of a name and every flush under a folder (`trace`). From these notes
`after_power_cut` makes a folder as a disk may hold it then:

- of a file, the content at its last flush; of what was written since, any pages, and any length;
- of the names, those that were flushed with their folder. Of later changes any may be there or not,
  in any order, but for those of one name, which keep theirs. A change of a name is never half done.

This is what POSIX guarantees; ext4 and others guarantee more. Whatever flushes its data with
anything but `os.fsync` counts as not flushed.
"""

import json
import os
import random
import shutil
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

PAGE = 4096  # Bytes that a disk writes at once
NOTES = "notes"  # Name of the file of notes


class _Trace:
    """Notes of one process; each is on its file before the change is made."""

    def __init__(self, folder: Path, store: Path, end_at: int):
        self._folder, self._store, self._end_at = str(folder.resolve()), store, end_at
        self._number, self._lock = 0, threading.RLock()
        self._file = os.open(store / NOTES, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        self._link, self._inside = os.link, threading.local()

    def name(self, path: Any) -> str | None:
        """Return a path relative to the folder; None if it is elsewhere."""
        if isinstance(path, int):
            return None
        full = os.path.abspath(os.fsdecode(path))  # noqa: PTH100 (links are not followed)
        inside = full.startswith(self._folder + os.sep) or full == self._folder
        return os.path.relpath(full, self._folder) if inside else None

    def note(self, what: str, **about: Any) -> None:
        with self._lock:
            self._number += 1
            if self._number == self._end_at:
                os.kill(os.getpid(), signal.SIGKILL)
            os.write(self._file, (json.dumps({"what": what} | about) + "\n").encode())

    def kept(self, name: str) -> str | None:
        """Keep a file whose name is about to go; return where."""
        path = Path(self._folder, name)
        if not path.is_file() or path.is_symlink():
            return None
        with self._lock:
            place = f"kept-{self._number}-{threading.get_ident()}"
            self._link(path, self._store / place)
        return place

    def changes(self, what: str, change: Callable[..., None]) -> Callable[..., None]:
        """Return a function of `os` that notes what it does."""

        def noted(*paths: Any, **options: Any) -> None:
            given = [path for path in paths if isinstance(path, str | bytes | Path)]
            names = [self.name(path) for path in given]
            by_descriptor = any(key.endswith("dir_fd") and options[key] for key in options)
            new = what in ("mkdir", "link")
            possible = what == "rename" or (given and os.path.lexists(given[-1]) != new)
            if possible and not by_descriptor and None not in names:
                last = names[-1] or ""
                kept = self.kept(last) if what in ("rename", "unlink") else None
                self.note(what, names=names, kept=kept)
            change(*paths, **options)

        return noted

    def flushed(self, change: Callable[[Any], None]) -> Callable[[Any], None]:
        def noted(entry: Any) -> None:
            change(entry)
            number = entry if isinstance(entry, int) else entry.fileno()
            name = self.name(os.readlink(f"/proc/self/fd/{number}"))  # noqa: PTH115
            if name is None:
                return
            path, copy = Path(self._folder, name), None
            if path.is_file():
                with self._lock:
                    copy = f"flushed-{self._number}-{threading.get_ident()}"
                    shutil.copyfile(path, self._store / copy)
            self.note("flush", names=[name], copy=copy)

        return noted

    def opened(self, event: str, arguments: tuple[Any, ...]) -> None:
        """Note a new file; called with the events that Python audits."""
        if event != "open" or not arguments[2] & os.O_CREAT or getattr(self._inside, "yes", False):
            return
        self._inside.yes = True
        try:
            name = self.name(arguments[0])
            if name is not None and not os.path.lexists(arguments[0]):
                self.note("create", names=[name])
        finally:
            self._inside.yes = False


def trace(folder: Path, store: Path, end_at: int = 0) -> None:
    """Note from now on what this process does under a folder.

    Args:
        folder: The folder.
        store: Existing empty folder on the same disk, for the notes.
        end_at: Number of the note before which the process kills itself; 0 for none.
    """
    noted = _Trace(folder, store, end_at)
    functions = {"rename": ("rename", "replace"), "unlink": ("unlink", "remove")}
    functions |= {name: (name,) for name in ("link", "mkdir", "rmdir")}
    for what, names in functions.items():
        for name in names:
            setattr(os, name, noted.changes(what, getattr(os, name)))
    os.fsync = noted.flushed(os.fsync)
    sys.addaudithook(noted.opened)


def notes_in(store: Path) -> list[dict[str, Any]]:
    """Return the notes of a process; the last may be cut off."""
    path = store / NOTES
    lines = path.read_text(encoding="utf-8").split("\n")[:-1] if path.exists() else []
    return [json.loads(line) for line in lines]


@dataclass
class _File:
    """A file, whatever its name."""

    flushed: Path | None = None
    """Its content on the disk."""
    names: list[str] = field(default_factory=list)
    """All that it had, the present one last."""
    kept: Path | None = None
    """Where it is, if it has no name any more."""


@dataclass
class _Change:
    """A change of names."""

    what: str
    names: list[str]
    file: _File | None = None
    flushed: bool = False

    def apply(self, names: dict[str, _File | None]) -> None:
        """Make the change; None is a folder."""
        first, last = self.names[0], self.names[-1]
        if self.what in ("create", "mkdir"):
            names.setdefault(first, self.file)
        elif self.what in ("unlink", "rmdir"):
            names.pop(first, None)
        elif self.what == "link" and first in names:
            names.setdefault(last, names[first])
        elif self.what == "rename" and first in names:
            names[last] = names.pop(first)


def after_power_cut(
    before: Path, live: Path, store: Path, out: Path, dice: random.Random
) -> dict[str, bool]:
    """Make a folder as a power cut may leave it.

    Args:
        before: Copy of the folder before the process; all of it is on the disk.
        live: The folder as the process left it, with what the disk does not have yet.
        store: Notes of the process.
        out: New folder.
        dice: Random numbers.

    Returns:
        The files in it, and whether each is as in ``live`` or was not flushed completely.
    """
    names: dict[str, _File | None] = dict(_tree(before))
    now = dict(names)
    changes: list[_Change] = []
    for note in notes_in(store):
        what, touched = note["what"], note["names"]
        first, last = touched[0], touched[-1]
        if what == "flush":
            file = now.get(first)
            if file and note["copy"]:
                file.flushed = store / note["copy"]
            for change in changes:
                change.flushed |= any(_folder_of(name) == first for name in change.names)
            continue
        file = _File(names=[first]) if what == "create" else now.get(first)
        if note.get("kept") and (gone := now.get(last)):
            gone.kept = store / note["kept"]
        change = _Change(what, touched, file)
        change.apply(now)
        changes.append(change)
        if file and last not in file.names:
            file.names.append(last)
    for change in _chosen(changes, dice):
        change.apply(names)
    return dict(_written(names, live, out, dice))


def _tree(folder: Path) -> Iterator[tuple[str, _File | None]]:
    yield ".", None
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        yield name, None if path.is_dir() else _File(path, [name])


def _folder_of(name: str) -> str:
    return os.path.dirname(name) or "."  # noqa: PTH120


def _chosen(changes: list[_Change], dice: random.Random) -> Iterator[_Change]:
    """Yield the changes that are on the disk: all flushed ones, and any that need no other."""
    likely = dice.choice((0.0, 0.5, 0.9, 1.0))
    missing: set[str] = set()
    for change in changes:
        needed = {*change.names, *map(_folder_of, change.names)}
        if (change.flushed or dice.random() < likely) and not needed & missing:
            yield change
        else:
            missing.update(change.names)


def _written(
    names: dict[str, _File | None], live: Path, out: Path, dice: random.Random
) -> Iterator[tuple[str, bool]]:
    """Write the files; yield the name of each, and whether it is complete."""
    for name in sorted(names):
        file, path = names[name], out / name
        if _folder_of(name) not in names:
            continue
        if file is None:
            path.mkdir(parents=True, exist_ok=True)
            continue
        places = [live / each for each in reversed(file.names)] + [file.kept, file.flushed]
        source = next((p for p in places if p is not None and p.is_file()), None)
        current = source.read_bytes() if source else b""
        flushed = file.flushed.read_bytes() if file.flushed else b""
        left = current if current == flushed else torn(flushed, current, dice)
        path.write_bytes(left)
        if left == current and source:
            shutil.copystat(source, path)
        yield name, left == current


def torn(flushed: bytes, current: bytes, dice: random.Random) -> bytes:
    """Return what a disk may hold of a file: any of the pages written since the last flush."""
    ends = sorted((len(flushed), len(current)))
    size = dice.choice((*ends, dice.randint(*ends)))
    left = bytearray(flushed[:size].ljust(size, b"\0"))
    likely = dice.choice((0.0, 0.5, 1.0))
    for at in range(0, size, PAGE):
        if dice.random() < likely:
            page = current[at : min(at + PAGE, size)]
            left[at : at + len(page)] = page
    return bytes(left)
