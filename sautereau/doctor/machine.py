"""What a bench needs of the machine it hangs on: room and speed of the disk, and the clock."""

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
"""Bytes that should be free where recordings go: some 2,000 presses."""
WRITTEN = 1 << 23
"""Bytes that are written to see how fast a disk takes them."""
DISK_MARGIN = 5.0
"""1, by which a disk should be faster than the samples that come."""
SAMPLE_BYTES = 8
BEHIND = 86_400.0
"""s, by which the clock may be behind this program's own files, which another machine dated."""


@dataclass(frozen=True)
class Finding:
    """One thing looked at."""

    name: str
    ok: bool
    detail: str
    remedy: str = ""
    """What to do about it; empty where all is well."""


def disk_room(folder: Path) -> Finding:
    """Look how much room there is where recordings go."""
    free = shutil.disk_usage(folder).free
    enough = free >= LEAST_SPACE
    detail = f"{free / 1e9:.1f} GB free in {folder.resolve()}"
    return Finding("disk", enough, detail, "" if enough else "free some space, or record elsewhere")


def disk_speed(folder: Path, daq: Daq) -> Finding:
    """Write 8 MiB through to the disk, and compare with what the channels bring.

    Args:
        folder: Where recordings will go; the file is gone afterwards.
        daq: Channels and their rate.
    """
    name, elsewhere = "disk speed", "record elsewhere: a disk of this machine is best"
    block = os.urandom(1 << 20)
    start = time.perf_counter()
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            for _ in range(WRITTEN // len(block)):
                file.write(block)
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        detail = f"nothing can be written in {folder.resolve()}: {error.strerror}"
        return Finding(name, False, detail, elsewhere)
    speed = WRITTEN / (time.perf_counter() - start)
    needed = SAMPLE_BYTES * len(daq.channels) * daq.sample_rate
    enough = speed >= DISK_MARGIN * needed
    detail = f"{speed / 1e6:.3g} MB/s, and the channels bring {needed / 1e6:.3g} MB/s"
    return Finding(name, enough, detail, "" if enough else elsewhere)


def clock(now: float | None = None) -> Finding:
    """Look whether the clock, from which recordings take their dates, can be right.

    Args:
        now: s since 1970; None for the clock itself.
    """
    now = time.time() if now is None else now
    detail = f"{datetime.fromtimestamp(now, UTC):%Y-%m-%d %H:%M:%S} UTC"
    newest = Path(__file__).stat().st_mtime
    if now < newest - BEHIND:
        installed = datetime.fromtimestamp(newest, UTC)
        detail += f", before this program was installed on {installed:%Y-%m-%d}"
        return Finding("clock", False, detail, "set the clock: recordings take their dates from it")
    kept = _kept_by_network_time()
    if kept is None:
        return Finding("clock", True, f"{detail}; whether network time keeps it is not known")
    if kept:
        return Finding("clock", True, f"{detail}, kept by network time")
    remedy = "let network time keep it (timedatectl set-ntp true), or see that its date is right"
    return Finding("clock", False, f"{detail}, not kept by network time", remedy)


def _kept_by_network_time() -> bool | None:
    """Return whether systemd says so; None where nobody can be asked."""
    asked = ("timedatectl", "show", "--property=NTPSynchronized", "--value")
    try:
        done = subprocess.run(asked, capture_output=True, text=True, timeout=5, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return {"yes": True, "no": False}.get(done.stdout.strip()) if done.returncode == 0 else None
