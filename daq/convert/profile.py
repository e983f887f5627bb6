"""Profiles: the options of an import in a TOML file, to use them again for files of one kind."""

import os
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import tomlkit
from pydantic import ConfigDict, Field, create_model

from sautereau.daq.convert.options import MODIFIED, ImportOptions
from sautereau.daq.errors import RecordingError
from sautereau.rig.disk import explained, write_durably
from sautereau.rig.faults import in_text, validating
from sautereau.rig.layers import read_toml_file


@dataclass(frozen=True)
class Profile(ImportOptions):
    """Options of an import, and the rig."""

    rig: str | None = None
    """Path of a rig file, relative to the profile's folder, or name of a packaged one."""

    def under(self, given: ImportOptions) -> ImportOptions:
        """Return the profile's options; those that are given replace them."""
        own = {one.name: getattr(self, one.name) for one in fields(ImportOptions)}
        for name, value in given.given().items():
            own[name] = own[name] | value if isinstance(value, dict) else value
        return ImportOptions(**own)


_DEFAULT = Profile()
_FIELDS: dict[str, Any] = {  # a tuple is an array in TOML
    one.name: (
        one.type,
        Field(getattr(_DEFAULT, one.name), strict=False if one.type == tuple[str, ...] else None),
    )
    for one in fields(Profile)
}
_TABLE = create_model("Profile", __config__=ConfigDict(extra="forbid", strict=True), **_FIELDS)
"""What a profile's file may hold."""


def load_profile(path: Path) -> Profile:
    """Read a profile.

    Raises:
        RecordingError: It cannot be read; lists every fault with its line.
    """
    origin = f"import profile {path}"
    text, values = read_toml_file(path, origin, RecordingError, "give a file of --save-profile")
    with validating(_TABLE, RecordingError, origin, in_text(text)):
        profile = Profile(**dict(_TABLE.model_validate(values)))
    with explained(RecordingError, f"{origin}: rig", "shorten the path"):
        if profile.rig is not None and (near := path.parent / profile.rig).is_file():
            return replace(profile, rig=str(near))
    return profile


def save_profile(path: Path, options: ImportOptions, rig: str | None) -> None:
    """Write the options of an import as a profile, except a date, which is that of one file.

    Raises:
        RecordingError: The file exists, or cannot be written.
    """
    values = options.given()
    if values.get("started") != MODIFIED:
        values.pop("started", None)
    if rig is not None:
        is_file = Path(rig).is_file()
        values["rig"] = Path(os.path.relpath(rig, path.parent)).as_posix() if is_file else rig
    ordered = dict(sorted(values.items(), key=lambda item: isinstance(item[1], dict)))
    fix = "nothing is overwritten: give another name"
    with explained(RecordingError, f"import profile {path}", fix):
        write_durably(path, tomlkit.dumps(ordered))
