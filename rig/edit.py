"""Write found values into a rig file: its comments, its order and all else stay as they are."""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sautereau.rig.disk import write_through
from sautereau.rig.errors import RigError
from sautereau.rig.faults import fault_list, model_keys, near_miss
from sautereau.rig.load import parse_rig
from sautereau.rig.schema import Rig


@dataclass(frozen=True)
class Edit:
    """A rig file as it is and as it would be; nothing is written before `save`."""

    path: Path
    before: str
    """Text of the file."""
    after: str
    """Text with the new values, which is a valid rig."""

    @property
    def difference(self) -> str:
        """The lines that change, as `diff -u` shows them; empty where none does."""
        lines = difflib.unified_diff(
            self.before.splitlines(), self.after.splitlines(), "now", "found", n=0, lineterm=""
        )
        return "\n".join(line for line in lines if not line.startswith("@@"))

    def save(self) -> None:
        """Put the new text in the place of the file: all of it, or nothing.

        Raises:
            RigError: The file has changed since it was read, or cannot be written.
        """
        if _read(self.path) != self.before:
            raise RigError(
                f"rig file {self.path}: it was changed by somebody else since it was read, so"
                " nothing was written; look at that change, then do the step again"
            )
        whole = self.path.with_name(f"{self.path.name}.new")
        try:
            write_through(whole, self.after, new=True)
            whole.chmod(self.path.stat().st_mode)
            whole.replace(self.path)
        except OSError as error:
            raise RigError(
                f"rig file {self.path}: it cannot be written by way of {whole.name}:"
                f" {error.strerror}; remove {whole.name} if it is there, or give yourself the"
                " right to write"
            ) from error


def edit_rig(path: str | Path, values: Mapping[str, str | float], source: str = "") -> Edit:
    """Put values into the text of a rig file.

    A value that is a table, with a range that was assumed for it, keeps the table and loses
    the range: it is known from now on.

    Args:
        path: The rig file; no packaged rig.
        values: TOML values by dotted key, such as ``{"arm.base_x": "-274.9 mm"}``; an entry of
            a list is named by its index.
        source: Where they come from; kept beside every value that stands in a table.

    Raises:
        RigError: The file cannot be read, a key does not exist, or the new rig is not valid.
    """
    import tomlkit

    path = Path(path)
    before = _read(path)
    parse_rig(before, str(path), path.parent)
    document = tomlkit.parse(before)
    faults = []
    for dotted, value in values.items():
        try:
            _put(document, dotted.split("."), value, source)
        except (KeyError, IndexError, TypeError, ValueError):
            faults.append(
                f"{dotted}: no such quantity in this file{near_miss(dotted, list(model_keys(Rig)))}"
            )
    if faults:
        raise RigError(fault_list(f"rig file {path}", faults))
    after = tomlkit.dumps(document)
    parse_rig(after, f"{path}, with what was found", path.parent)
    return Edit(path, before, after)


def _put(node: Any, keys: list[str], value: str | float, source: str) -> None:
    """Set what is found along the keys in the document; a key that is new is the last one."""
    import tomlkit

    *parents, last = keys
    for key in parents:
        node = node[int(key)] if isinstance(node, list) else node[key]
    place: Any = int(last) if isinstance(node, list) else last
    old = node.get(last) if isinstance(node, dict) else node[place]
    if isinstance(old, dict):
        if "value" not in old:
            raise KeyError(last)
        known = tomlkit.inline_table()
        known.update({key: kept for key, kept in old.items() if key != "assumed"})
        known.update({"value": value} | ({"source": source} if source else {}))
        node[place] = known
    else:
        node[place] = value


def _read(path: Path) -> str:
    """Return the text of the file with its line ends as they are."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return file.read()
    except (OSError, ValueError) as error:
        raise RigError(
            f"rig file {path}: cannot be read: {error}; give the path of a rig file of your own:"
            " a packaged rig is not written into"
        ) from error
