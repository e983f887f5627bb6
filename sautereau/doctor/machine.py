"""Checks of this machine: space and speed of the disk, and the clock."""

import os
import shutil
import subprocess
import tempfile
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from sautereau.rig.acquisition import Daq

LEAST_SPACE = 1e9
"""Bytes that should be free for recordings: about 2,000 presses."""
WRITTEN = 1 << 23
"""Bytes that are written to measure the speed of a disk."""
DISK_MARGIN = 5.0
"""Dimensionless factor by which a disk should be faster than the acquisition."""
SAMPLE_BYTES = 8
BEHIND = 86_400.0
"""s, by which the clock may be behind the dates of this program's files, set elsewhere."""


@dataclass(frozen=True)
class Finding:
    """Result of one check."""

    name: str
    ok: bool
    detail: str
    how_to_fix: str = ""
    """How to fix it; empty if the check passed."""


def disk_room(folder: Path) -> Finding:
    """Check the free space for recordings."""
    free = shutil.disk_usage(folder).free
    enough = free >= LEAST_SPACE
    detail = f"{free / 1e9:.1f} GB free in {folder.resolve()}"
    return Finding(
        "disk", enough, detail, "" if enough else "delete files, or record to another disk"
    )


def disk_speed(folder: Path, daq: Daq) -> Finding:
    """Write 8 MiB to the disk, and compare its speed with the data rate of the channels.

    Args:
        folder: Folder for recordings; the file is deleted afterwards.
        daq: Channels and their sample rate.
    """
    name, elsewhere = "disk speed", "record to another disk, preferably a local one"
    block = os.urandom(1 << 20)
    start = time.perf_counter()
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            for _ in range(WRITTEN // len(block)):
                file.write(block)
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        detail = f"no file can be written to {folder.resolve()}: {error.strerror}"
        return Finding(name, False, detail, elsewhere)
    speed = WRITTEN / (time.perf_counter() - start)
    needed = SAMPLE_BYTES * len(daq.channels) * daq.sample_rate
    enough = speed >= DISK_MARGIN * needed
    detail = f"{speed / 1e6:.3g} MB/s; the channels need {needed / 1e6:.3g} MB/s"
    return Finding(name, enough, detail, "" if enough else elsewhere)


def clock(now: float | None = None) -> Finding:
    """Check whether the clock, which dates the recordings, can be right.

    Args:
        now: s since 1970; None for the clock of this machine.
    """
    now = time.time() if now is None else now
    detail = f"{datetime.fromtimestamp(now, UTC):%Y-%m-%d %H:%M:%S} UTC"
    newest = Path(__file__).stat().st_mtime
    if now < newest - BEHIND:
        installed = datetime.fromtimestamp(newest, UTC)
        detail += f", before this program was installed on {installed:%Y-%m-%d}"
        return Finding("clock", False, detail, "set the clock, which dates the recordings")
    synchronised = _synchronised()
    if synchronised is None:
        return Finding("clock", True, f"{detail}; network synchronisation unknown")
    if synchronised:
        return Finding("clock", True, f"{detail}, synchronised with network time")
    fix = "synchronise it (timedatectl set-ntp true), or check its date"
    return Finding("clock", False, f"{detail}, not synchronised with network time", fix)


def _synchronised() -> bool | None:
    """Return whether systemd reports a synchronised clock; None without systemd."""
    command = ("timedatectl", "show", "--property=NTPSynchronized", "--value")
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=5, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return {"yes": True, "no": False}.get(done.stdout.strip()) if done.returncode == 0 else None
