"""The formats and protocols that are tried, by name."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

_PLACES = {
    "recording": "recordings:Recordings",
    "analysis": "recordings:Analysis",
    "export": "recordings:Exports",
}


def _make(place: str) -> Callable[[Path], Any]:
    module, name = place.split(":")
    return getattr(import_module(f"tests.fuzz.{module}"), name)


TARGETS = {name: lambda place=place: _make(place) for name, place in _PLACES.items()}
"""Functions that return what makes a target in a folder."""
