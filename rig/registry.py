"""Named implementations: those of sautereau, and those that other installed packages provide."""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import PydanticCustomError, core_schema

from sautereau.rig.errors import SautereauError


class Registry:
    """Implementations by name; each is imported when it is first asked for.

    Another package adds one by an entry point of its own pyproject.toml::

        [project.entry-points."sautereau.controllers"]
        toy = "toy_package.driver:ToyController"

    Args:
        group: Entry-point group, `sautereau.controllers`.
        what: Kind of the implementations, for messages: `controller`.
        built_in: `module:attribute` of each implementation of sautereau, by name, in the order
            in which they are listed.
        error: Class of the error that an unknown name raises.
    """

    def __init__(
        self, group: str, what: str, built_in: Mapping[str, str], error: type[SautereauError]
    ):
        self.group, self.what, self._error = group, what, error
        self._built_in = {name: EntryPoint(name, at, group) for name, at in built_in.items()}

    def names(self) -> list[str]:
        """Return all names: sautereau's own in their order, then those of other packages."""
        others = {point.name for point in entry_points(group=self.group)}
        return [*self._built_in, *sorted(others - set(self._built_in))]

    def get(self, name: str) -> Any:
        """Return the implementation of a name.

        Raises:
            SautereauError: No package provides this name; or importing it failed.
        """
        point = self._built_in.get(name)
        if point is None:
            point = next(iter(entry_points(group=self.group, name=name)), None)
        if point is None:
            known = self.names()
            close = difflib.get_close_matches(name, known, n=1)
            meant = f"did you mean {close[0]!r}? " if close else ""
            raise self._error(
                f"{self.what} {name!r} is unknown; {meant}known: {', '.join(known)}. Another"
                f" package adds one by an entry point in the group {self.group!r}"
            )
        try:
            return point.load()
        except (ImportError, AttributeError) as error:
            raise self._error(
                f"{self.what} {name!r} cannot be imported from {point.value!r}: {error}; reinstall"
                " the package that provides it"
            ) from error


@dataclass(frozen=True)
class NameIn:
    """Annotation of a text field that holds a name of a registry."""

    registry: Registry

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.no_info_after_validator_function(self._known, handler(source))

    def _known(self, name: str) -> str:
        try:
            self.registry.get(name)
        except SautereauError as error:
            raise PydanticCustomError("unknown_name", "{fault}", {"fault": str(error)}) from error
        return name
