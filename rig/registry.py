"""Implementations by name: sautereau's own, and those of other packages; motion controllers."""

import difflib
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from typing import TYPE_CHECKING, Any

from sautereau.rig.errors import RigError, SautereauError

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler
    from pydantic_core import CoreSchema


class Registry:
    """Implementations by name; each is imported when it is first used.

    Another package adds one by an entry point of its own pyproject.toml::

        [project.entry-points."sautereau.controllers"]
        toy = "toy_package.driver:ToyController"

    The names of sautereau itself are reserved: an entry point with one of them is ignored, so
    that installing a package never changes what an existing rig file or command does. A name
    that two other packages provide is refused.

    Args:
        group: Entry-point group, `sautereau.controllers`.
        what: Kind of implementation, for messages: `controller`.
        built_in: `module:attribute` of each implementation of sautereau, by name, in the order
            in which they are listed.
    """

    def __init__(
        self, group: str, what: str, built_in: Mapping[str, str], error: type[SautereauError]
    ):
        self.group, self.what, self._error = group, what, error
        self._built_in = {name: EntryPoint(name, at, group) for name, at in built_in.items()}

    def names(self) -> list[str]:
        """Return all names: sautereau's own in their order, then those of other packages."""
        others = self._provided().names
        return [*self._built_in, *sorted(others - set(self._built_in))]

    def get(self, name: str) -> Any:
        """Return the implementation of a name.

        Raises:
            SautereauError: No package or several packages provide this name, or importing it
                failed.
        """
        if name in self._built_in:
            return self._load(self._built_in[name])
        points = list(self._provided().select(name=name))
        if len(points) > 1:
            places = " and ".join(sorted(repr(point.value) for point in points))
            raise self._error(
                f"{self.what} {name!r} is provided by several packages, from {places}; uninstall"
                " all of them but one"
            )
        if not points:
            raise self._error(f"{self.what} {self.unknown(name)}")
        return self._load(points[0])

    def unknown(self, name: str) -> str:
        """Return what is wrong with a name that no package provides; empty if one does."""
        known = self.names()
        if name in known:
            return ""
        close = difflib.get_close_matches(name, known, n=1)
        meant = f"did you mean {close[0]!r}? " if close else ""
        return (
            f"{name!r} is unknown; {meant}known: {', '.join(known)}. Another package adds one in"
            f" the entry points {self.group!r}"
        )

    def _provided(self) -> EntryPoints:
        try:
            path = tuple(map(os.path.abspath, sys.path))
        except FileNotFoundError:  # the working folder was removed, and `sautereau` will say so
            path = tuple(sys.path)
        return _installed(self.group, path)

    def _load(self, point: EntryPoint) -> Any:
        try:
            return point.load()
        except (ImportError, AttributeError) as error:
            raise self._error(
                f"{self.what} {point.name!r} cannot be imported from {point.value!r}: {error};"
                " reinstall the package that provides it"
            ) from error


@cache
def _installed(group: str, path: tuple[str, ...]) -> EntryPoints:
    """Return a group's entry points of all packages on a search path; the files are read once.

    Args:
        path: Absolute, because an entry of `sys.path` may be relative to the working directory.
    """
    return entry_points(group=group)


@dataclass(frozen=True)
class NameIn:
    """Annotation of a text field that holds a name of a registry."""

    registry: Registry
    imported: bool = True
    """Whether the implementation is imported, which may be slow, or only looked up."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: "GetCoreSchemaHandler"
    ) -> "CoreSchema":
        from pydantic_core import core_schema

        return core_schema.no_info_after_validator_function(self._known, handler(source))

    def _known(self, name: str) -> str:
        from pydantic_core import PydanticCustomError

        if self.imported or self.registry.unknown(name):
            try:
                self.registry.get(name)
            except SautereauError as error:
                about = {"fault": str(error)}
                raise PydanticCustomError("unknown_name", "{fault}", about) from error
        return name


CONTROLLERS = Registry(
    "sautereau.controllers",
    "controller",
    {
        "galil": "sautereau.robot.drivers.galil.driver:GalilController",
        "odrive": "sautereau.robot.drivers.odrive.driver:OdriveController",
    },
    RigError,
)
"""Each is called with a `Rig` and returns a `sautereau.robot.controller.MotionController`."""

SOURCES = Registry(
    "sautereau.sources",
    "acquisition driver",
    {
        "nidaqmx": "sautereau.daq.source.acquisition:Acquisition",
        "sound-card": "sautereau.daq.source.sound_card:SoundCard",
    },
    RigError,
)
"""Each is called with a `Daq`, a duration and `triggered`, and returns a
`sautereau.daq.source.source.Source`."""
