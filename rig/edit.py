"""Write new values into a rig file without changing anything else, its comments included."""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import Array

from sautereau.rig.disk import explained, read_text, write_durably
from sautereau.rig.document import current_key, rename_keys
from sautereau.rig.errors import RigError
from sautereau.rig.faults import bare_key, fault_list, model_keys, near_miss
from sautereau.rig.load import parse_rig
from sautereau.rig.schema import Rig

TomlValue = str | float | list[str] | list[dict[str, str | float]] | dict[str, Any]
"""A value of a rig file, or its table; a list replaces the one before."""


@dataclass(frozen=True)
class Edit:
    """A rig file before and after a change; `save` writes it."""

    path: Path
    before: str
    """Current text of the file."""
    after: str
    """Text with the new values, which is a valid rig."""

    @property
    def difference(self) -> str:
        """The changed lines as `diff -u` shows them; empty if none changes."""
        lines = difflib.unified_diff(
            self.before.splitlines(), self.after.splitlines(), "now", "found", n=0, lineterm=""
        )
        return "\n".join(line for line in lines if not line.startswith("@@"))

    def save(self) -> None:
        """Replace the file by the new text, completely or not at all.

        Raises:
            RigError: The file has changed since it was read, or cannot be written.
        """
        if _read(self.path) != self.before:
            raise RigError(
                f"rig file {self.path}: another program changed it since it was read, so nothing"
                " was written; check that change, then repeat this step"
            )
        origin = f"rig file {self.path}: nothing was changed"
        with explained(RigError, origin, "check its folder and disk"):
            write_durably(self.path, self.after, replace=True)


def edit_rig(
    path: str | Path, values: Mapping[str, TomlValue], source: str = "", *, every: bool = False
) -> Edit:
    """Put values into the text of a rig file.

    A value of its base is written as a difference, and the base is left as it is. A value written
    as a table keeps its table without the assumed range, since it is now known.
    A file with the old name of a renamed key keeps that name.

    Args:
        path: The user's rig file; packaged rigs are never changed.
        values: TOML values by dotted key, such as ``{"arm.base_x": "-274.9 mm"}``, or tables
            with the keys ``value`` and ``assumed``; an entry of a list is named by its index.
        source: Origin of the values; written into every value that is a table.
        every: Make tables of the other values, so that all have their source.

    Raises:
        RigError: The file cannot be read, a key does not exist, or the new rig is not valid.
    """
    path = Path(path)
    before = _read(path)
    return Edit(
        path, before, edited_text(before, str(path), path.parent, values, source, every=every)
    )


def edited_text(
    text: str,
    origin: str,
    folder: Path,
    values: Mapping[str, TomlValue],
    source: str = "",
    *,
    every: bool = False,
) -> str:
    """Return the text of a rig file with new values; see `edit_rig`.

    Args:
        folder: Folder of the files that it names.

    Raises:
        RigError: A key does not exist, or the new rig is not valid.
    """
    known = parse_rig(text, origin, folder)
    with_origin = {*known.assumed, *known.sources}
    document = tomlkit.parse(text)
    in_file = {current_key(old): old for old in rename_keys(document.unwrap())}
    faults = []
    for dotted, value in values.items():
        try:
            keys = in_file.get(dotted, dotted).split(".")
            _put(document, keys, value, source, every or dotted in with_origin)
        except (KeyError, IndexError, TypeError, ValueError):
            faults.append(f"{dotted}: unknown quantity{near_miss(dotted, list(model_keys(Rig)))}")
    if faults:
        raise RigError(fault_list(f"rig file {origin}", faults))
    after = tomlkit.dumps(document)
    parse_rig(after, f"{origin} with the new values", folder)
    return after


def _put(node: Any, keys: list[str], value: TomlValue, source: str, every: bool) -> None:
    """Set the value at a key of the document; only its last part may be new, or what a base has."""
    *parents, last = keys
    inherits = "base" in node and bare_key(".".join(keys)) in model_keys(Rig)
    for number, key in enumerate(parents):
        if inherits and isinstance(node, dict) and key not in node:
            node[key] = tomlkit.table(is_super_table=number < len(parents) - 1)
        node = node[int(key)] if isinstance(node, list) else node[key]
    index: Any = int(last) if isinstance(node, list) else last
    old = node.get(last) if isinstance(node, dict) else node[index]
    given = dict(value) if isinstance(value, dict) else {"value": value}
    kept = old if isinstance(old, dict) else None
    if kept is not None and "value" not in kept:
        raise KeyError(last)
    stated = every and source and isinstance(node, dict)
    if kept is not None or stated or isinstance(value, dict):
        known = tomlkit.inline_table()
        known.update({key: own for key, own in (kept or {}).items() if key != "assumed"})
        known.update(given | ({"source": source} if source else {}))
        node[index] = known
    else:
        item = tomlkit.item(value)
        node[index] = item.multiline(True) if isinstance(item, Array) else item


def _read(path: Path) -> str:
    """Return the text of the file with its line ends unchanged."""
    fix = "give the path of your own rig file: packaged rigs are never changed"
    with explained(RigError, f"rig file {path}: cannot be read", fix):
        return read_text(path)
