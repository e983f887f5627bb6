"""What is installed, connected and missing on this machine, and how to fix it."""

import os
import re
import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

from sautereau.doctor.machine import Finding, clock, disk_room, disk_speed
from sautereau.rig.schema import Rig


def examine(rig: Rig, folder: Path) -> list[Finding]:
    """Check Python, packages, serial port, DAQ device, disk and clock; nothing moves.

    Args:
        rig: Rig whose port and device are checked.
        folder: Folder for recordings.
    """
    return [
        _python(),
        *_packages(),
        _serial(rig.controller.port),
        _daq(rig),
        _stand_in(),
        disk_room(folder),
        disk_speed(folder, rig.daq),
        clock(),
    ]


def _python() -> Finding:
    version = ".".join(map(str, sys.version_info[:3]))
    return Finding("python", sys.version_info >= (3, 11), version, "install Python 3.11 or newer")


def _packages() -> Iterator[Finding]:
    """Check all requirements of this program except those of its extras."""
    for text in metadata.requires("sautereau") or []:
        requirement, _, marker = text.partition(";")
        if "extra ==" in marker:
            continue
        name = re.split(r"[\s\[<>=!~(]", requirement, maxsplit=1)[0]
        try:
            yield Finding(name, True, metadata.version(name))
        except metadata.PackageNotFoundError:
            fix = f'python -m pip install "{requirement.strip()}"'
            yield Finding(name, False, "not installed", fix)


def _serial(port: str) -> Finding:
    from serial.tools.list_ports import comports

    found = [p.device for p in comports()]
    if "://" in port:
        return Finding("controller", True, f"{port}, a URL: not checked")
    if os.name == "nt":
        exists, allowed = port in found, True
    else:
        exists, allowed = Path(port).exists(), os.access(port, os.R_OK | os.W_OK)
    if not exists:
        fix = "connect the controller; `sautereau setup port` finds its port"
        detail = f"{port} does not exist; serial ports: {', '.join(found) or 'none'}"
        return Finding("controller", False, detail, fix)
    if not allowed:
        group = _group(Path(port))
        detail = f"no permission to open {port}, which belongs to the group {group}"
        fix = f"sudo usermod -aG {group} $USER, then log in again"
        return Finding("controller", False, detail, fix)
    return Finding("controller", True, f"{port} exists and can be opened")


def _group(port: Path) -> str:
    """Return the group of a port by name, or by number if it has no name."""
    try:
        return port.group()
    except KeyError:
        return str(port.stat().st_gid)


def _daq(rig: Rig) -> Finding:
    from sautereau.daq.errors import DaqError
    from sautereau.daq.source.acquisition import Acquisition

    try:
        with Acquisition(rig.daq, 0.1) as acquisition:
            return Finding("daq", True, acquisition.device_description)
    except DaqError as error:
        detail, _, fix = str(error).partition("; ")
        return Finding("daq", False, detail, fix)


def _stand_in() -> Finding:
    kind = "a pseudo-terminal" if hasattr(os, "openpty") else "socket:// on loopback"
    return Finding("stand-in", True, f"runs here, over {kind}: sautereau press --sim --out out")
