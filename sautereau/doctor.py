"""What is installed, connected and missing on this machine, and how to fix it."""

import os
import platform
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import import_module, metadata
from pathlib import Path

from sautereau.rig.acquisition import Daq
from sautereau.rig.schema import Rig

LEAST_SPACE = 1e9  # Bytes that should be free for recordings: about 2,000 presses
WRITTEN = 1 << 23  # Bytes that are written to measure the speed of a disk
DISK_MARGIN = 5.0  # Dimensionless factor by which a disk should be faster than the acquisition


@dataclass(frozen=True)
class Finding:
    """Result of one check."""

    name: str
    ok: bool
    detail: str
    how_to_fix: str = ""
    """How to fix it; empty if the check passed."""


def examine(rig: Rig, folder: Path) -> list[Finding]:
    """Check Python, packages, serial port, DAQ device, disk and clock; nothing moves.

    Args:
        rig: Rig whose port and device are checked.
        folder: Folder for recordings.
    """
    return [
        Finding("python", True, platform.python_version()),
        *_packages(),
        _extras(),
        _serial(rig.controller.port),
        _daq(rig),
        _stand_in(),
        disk_room(folder),
        disk_speed(folder, rig.daq),
        clock(),
    ]


def _packages() -> Iterator[Finding]:
    """Check all requirements of this program except those of its extras."""
    for text in metadata.requires("sautereau") or []:
        requirement, _, marker = text.partition(";")
        if "extra ==" in marker:
            continue
        name = _name(requirement)
        if _installed(name):
            yield Finding(name, True, metadata.version(name))
        else:
            fix = f'python -m pip install "{requirement.strip()}"'
            yield Finding(name, False, "not installed", fix)


def _extras() -> Finding:
    """List the extras whose packages are installed, and those that are not."""
    of_extras: dict[str, list[bool]] = {}
    for text in metadata.requires("sautereau") or []:
        requirement, _, marker = text.partition(";")
        if (extra := re.search(r"extra == ['\"]([\w-]+)['\"]", marker)) and "[" not in requirement:
            of_extras.setdefault(extra[1], []).append(_installed(_name(requirement)))
    there = [name for name, installed in of_extras.items() if all(installed)]
    faults = ""
    if "sound" in there and (why := _without_portaudio()):
        there.remove("sound")
        faults = f"; {why}"
    lacking = [name for name in of_extras if name not in there]
    detail = f"installed: {', '.join(there) or 'none'}"
    if lacking:
        more = f"python -m pip install 'sautereau[{lacking[0]}]'"
        detail += f"; not installed: {', '.join(lacking)}; add one, if you need it, with `{more}`"
    return Finding("extras", True, detail + faults)


def _without_portaudio() -> str:
    """Return why sounddevice does not run; empty if it does."""
    from sautereau.daq.errors import DaqError
    from sautereau.daq.source.sound_card import library

    try:
        library()
    except DaqError as error:
        return str(error)
    return ""


def _name(requirement: str) -> str:
    return re.split(r"[\s\[<>=!~(]", requirement, maxsplit=1)[0]


def _installed(name: str) -> bool:
    try:
        return bool(metadata.version(name))
    except metadata.PackageNotFoundError:
        return False


def _serial(port: str) -> Finding:
    from serial.tools.list_ports import comports

    from sautereau.robot.drivers.serial_port import latency

    found = [p.device for p in comports()]
    if "://" in port:
        return Finding("controller", True, f"{port}, a URL: not checked")
    if os.name == "nt" or "\0" in port:
        exists, allowed = port in found, True
    else:
        exists, allowed = Path(port).exists(), os.access(port, os.R_OK | os.W_OK)
    if not exists:
        fix = "connect the controller; `sautereau setup port` finds its port"
        detail = f"{port} does not exist; serial ports: {', '.join(found) or 'none'}"
        return Finding("controller", False, detail, fix)
    if not allowed:
        try:
            group = Path(port).group()
        except KeyError:  # it has no name
            group = str(Path(port).stat().st_gid)
        detail = f"no permission to open {port}, which belongs to the group {group}"
        fix = f"sudo usermod -aG {group} $USER, then log in again"
        return Finding("controller", False, detail, fix)
    detail, wait = f"{port} exists and can be opened", latency(port)
    if wait is not None and wait > 2e-3:  # half the interval of an ODrive's setpoints
        detail += (
            f"; its adapter collects bytes for {wait * 1e3:g} ms, which is set to 1 ms while the"
            " port is open; if setpoints are skipped, `echo 1 | sudo tee /sys/bus/usb-serial/"
            f"devices/{Path(port).resolve().name}/latency_timer`"
        )
    return Finding("controller", True, detail)


def _daq(rig: Rig) -> Finding:
    from sautereau.daq.errors import DaqError
    from sautereau.daq.source.source import open_source

    try:
        with open_source(rig.daq, 0.1) as acquisition:
            return Finding("daq", True, acquisition.device_description)
    except DaqError as error:
        detail, _, fix = str(error).partition("; ")
        return Finding("daq", False, detail, fix)


def _stand_in() -> Finding:
    try:
        import_module("sautereau.sim_backend.bench")
    except ImportError as error:
        fix = "python -m pip install --force-reinstall sautereau"
        return Finding("stand-in", False, f"cannot be loaded: {error}", fix)
    kind = "a pseudo-terminal" if hasattr(os, "openpty") else "socket:// on loopback"
    return Finding("stand-in", True, f"runs here, over {kind}: sautereau press --sim")


def disk_room(folder: Path) -> Finding:
    """Check the free space for recordings."""
    free = shutil.disk_usage(folder).free
    enough = free >= LEAST_SPACE
    detail = f"{free / 1e9:.1f} GB free in {folder.resolve()}"
    fix = "" if enough else "delete files, or record to another disk"
    return Finding("disk", enough, detail, fix)


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
    needed = 8 * len(daq.channels) * daq.sample_rate
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
    if now < newest - 86_400.0:  # A day: the files may be from elsewhere
        installed = datetime.fromtimestamp(newest, UTC)
        detail += f", before this program was installed on {installed:%Y-%m-%d}"
        return Finding("clock", False, detail, "set the clock; recordings get their dates from it")
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
