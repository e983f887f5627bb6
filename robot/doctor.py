"""What is installed, connected and missing on this machine, each with its remedy."""

import os
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from rig.schema import Rig

PACKAGES = (
    "numpy",
    "scipy",
    "pandas",
    "pymunk",
    "pyserial",
    "nidaqmx",
    "mcap",
    "pyarrow",
    "tomlkit",
    "matplotlib",
)
LEAST_SPACE = 1e9
"""Bytes that should be free where recordings go: some 2,000 presses."""


@dataclass(frozen=True)
class Finding:
    """One thing looked at."""

    name: str
    ok: bool
    detail: str
    remedy: str = ""
    """What to do about it; empty where all is well."""


def examine(rig: Rig, folder: Path) -> list[Finding]:
    """Look at Python, packages, serial port, DAQ device and disk; nothing is moved.

    Args:
        rig: The bench whose port and device are looked for.
        folder: Where recordings will go.
    """
    return [_python(), *_packages(), _serial(rig), _daq(rig), _stand_in(), _disk(folder)]


def _python() -> Finding:
    version = ".".join(map(str, sys.version_info[:3]))
    return Finding("python", sys.version_info >= (3, 11), version, "install Python 3.11 or newer")


def _packages() -> Iterator[Finding]:
    for name in PACKAGES:
        try:
            yield Finding(name, True, metadata.version(name))
        except metadata.PackageNotFoundError:
            yield Finding(name, False, "not installed", f"python -m pip install {name}")


def _serial(rig: Rig) -> Finding:
    from serial.tools.list_ports import comports

    port = rig.controller.port
    found = ", ".join(p.device for p in comports()) or "none"
    if "://" in port:
        return Finding("controller", True, f"{port}, a URL: not tried")
    if not Path(port).exists():
        remedy = "plug the controller in; `sautereau setup port` finds where it is"
        return Finding("controller", False, f"{port} is not there; serial ports: {found}", remedy)
    if not os.access(port, os.R_OK | os.W_OK):
        remedy = "add yourself to the group that owns the port (often dialout) and log in again"
        return Finding("controller", False, f"{port} may not be opened by you", remedy)
    return Finding("controller", True, f"{port} is there and may be opened")


def _daq(rig: Rig) -> Finding:
    from daq.acquisition import Acquisition
    from daq.errors import DaqError

    try:
        with Acquisition(rig.daq, 0.1) as acquisition:
            return Finding("daq", True, acquisition.device_description)
    except DaqError as error:
        detail, _, remedy = str(error).partition("; ")
        return Finding("daq", False, detail, remedy)


def _stand_in() -> Finding:
    kind = "a pseudo-terminal" if hasattr(os, "openpty") else "socket:// on loopback"
    return Finding("stand-in", True, f"runs here, over {kind}: sautereau press --sim --out out")


def _disk(folder: Path) -> Finding:
    free = shutil.disk_usage(folder).free
    enough = free >= LEAST_SPACE
    detail = f"{free / 1e9:.1f} GB free in {folder.resolve()}"
    return Finding("disk", enough, detail, "" if enough else "free some space, or record elsewhere")
