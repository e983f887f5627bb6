"""What is installed, connected and missing on this machine, each with its remedy."""

import os
import re
import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

from sautereau.doctor.machine import Finding, clock, disk_room, disk_speed
from sautereau.rig.schema import Rig

PACKAGE = "sautereau"


def examine(rig: Rig, folder: Path) -> list[Finding]:
    """Look at Python, packages, serial port, DAQ device, disk and clock; nothing is moved.

    Args:
        rig: The bench whose port and device are looked for.
        folder: Where recordings will go.
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
    """Look for whatever this program was installed with, extras left out."""
    try:
        needed = metadata.requires(PACKAGE) or []
    except metadata.PackageNotFoundError:
        remedy = "python -m pip install -e . in the checkout"
        yield Finding(PACKAGE, False, "run from a folder, and not installed", remedy)
        return
    for requirement in needed:
        wanted, _, marker = requirement.partition(";")
        if "extra ==" in marker:
            continue
        name = re.split(r"[\s\[<>=!~(]", wanted, maxsplit=1)[0]
        try:
            yield Finding(name, True, metadata.version(name))
        except metadata.PackageNotFoundError:
            yield Finding(name, False, "not installed", f'python -m pip install "{wanted.strip()}"')


def _serial(port: str) -> Finding:
    from serial.tools.list_ports import comports

    found = [p.device for p in comports()]
    if "://" in port:
        return Finding("controller", True, f"{port}, a URL: not tried")
    if os.name == "nt":
        there, allowed = port in found, True
    else:
        there, allowed = Path(port).exists(), os.access(port, os.R_OK | os.W_OK)
    if not there:
        remedy = "plug the controller in; `sautereau setup port` finds where it is"
        detail = f"{port} is not there; serial ports: {', '.join(found) or 'none'}"
        return Finding("controller", False, detail, remedy)
    if not allowed:
        group = _group(Path(port))
        detail = f"{port} may not be opened by you; it belongs to the group {group}"
        remedy = f"sudo usermod -aG {group} $USER, then log in again"
        return Finding("controller", False, detail, remedy)
    return Finding("controller", True, f"{port} is there and may be opened")


def _group(port: Path) -> str:
    """Return the group of a port by name, or by number where it has none."""
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
        detail, _, remedy = str(error).partition("; ")
        return Finding("daq", False, detail, remedy)


def _stand_in() -> Finding:
    kind = "a pseudo-terminal" if hasattr(os, "openpty") else "socket:// on loopback"
    return Finding("stand-in", True, f"runs here, over {kind}: sautereau press --sim --out out")
