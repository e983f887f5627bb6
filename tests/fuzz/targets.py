"""The formats and protocols that are tried, by name."""

from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

SURROUNDINGS = ("names", "environment", "calls", "clocks", "disks")
_PLACES = {
    "recording": "recordings:Recordings",
    "lengths": "recordings:Lengths",
    "analysis": "recordings:Analysis",
    "export": "recordings:Exports",
    "rig": "texts:Rigs",
    "curve": "texts:Curves",
    "scene": "texts:Scenes",
    "plan": "texts:PlanTables",
    "session": "texts:Sessions",
    "learned": "texts:Learned",
    "profile": "texts:Profiles",
    "labels": "texts:Labels",
    "fit": "texts:Fits",
    "campaign": "tables:Campaigns",
    "command": "commands:Commands",
    **dict.fromkeys(
        (
            "csv",
            "parquet",
            "wav",
            "tdms",
            "mat",
            "npz",
            "npy",
            "h5",
            "lvm",
            "uff",
            "xlsx",
            "flac",
            "mf4",
            "mcap",
            "db3",
        ),
        "imports:Imports",
    ),
    **dict.fromkeys(SURROUNDINGS, "surroundings:Surroundings"),
}


_PROTOCOLS = (
    "galil-emulator", "galil-driver", "odrive-emulator", "odrive-driver", "card-server",
    "card-client",
)  # fmt: skip


def _make(name: str) -> Callable[[Path], Any]:
    if name in _PROTOCOLS:
        return partial(import_module("tests.fuzz.protocols").make, name)
    module, kind = _PLACES[name].split(":")
    made = getattr(import_module(f"tests.fuzz.{module}"), kind)
    return partial(made, kind=name) if kind in ("Imports", "Surroundings") else made


TARGETS = {name: partial(_make, name) for name in (*_PLACES, *_PROTOCOLS)}
"""Functions that return what makes a target in a folder."""
