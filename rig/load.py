"""Read a rig file, report all its faults at once, and write a rig back."""

import copy
import json
import logging
import re
import sys
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pydantic import BaseModel, ValidationError

from sautereau.rig.csv_files import read_gesture
from sautereau.rig.errors import RigError
from sautereau.rig.faults import (
    at_line,
    fault_list,
    line_of,
    model_keys,
    near_miss,
    submodel,
    unit_of,
    validation_faults,
)
from sautereau.rig.named import RENAMED_KEYS, current_key, rename_keys
from sautereau.rig.packaged import named_text
from sautereau.rig.schema import Rig
from sautereau.rig.units import format_quantity, parse_quantity, shown

_LOG = logging.getLogger(__name__)
DEEPEST = 20
"""Limit of the depth of tables and arrays in a file; those of a rig or a scene are 6 deep."""
_TOO_DEEP = f"its tables or arrays are nested more than {DEEPEST} deep; shorten it"


def load_rig(name: str | Path = "paper") -> Rig:
    """Load a rig from a TOML file, or a packaged one by its name.

    Raises:
        RigError: Lists every fault of the file with its line, value, what is allowed.
    """
    return parse_rig(*named_text(name, "sautereau.rig", "rig", RigError))


def load_rig_to_acquire(name: str | Path) -> Rig:
    """Load a rig to record without a press: its file may have `[daq]` alone, and a `name`.

    The other values are then those of the packaged rig, and `Rig.daq_only` says so.

    Raises:
        RigError: Lists every fault of the file.
    """
    text, origin, folder = named_text(name, "sautereau.rig", "rig", RigError)
    tables = set(read_toml(text, origin, RigError))
    if "daq" not in tables or not tables <= {"name", "daq"}:
        return parse_rig(text, origin, folder)
    packaged, *_ = named_text("paper", "sautereau.rig", "rig", RigError)
    others = read_toml(packaged, "paper", RigError) | {"name": Path(name).stem}
    return parse_rig(text, origin, folder, others).model_copy(update={"daq_only": True})


def parse_rig(
    text: str,
    origin: str = "rig",
    folder: Path | None = None,
    others: Mapping[str, Any] = MappingProxyType({}),
) -> Rig:
    """Build a rig from the text of a TOML file.

    A key that was renamed is accepted under its old name, with a note on standard error.

    Args:
        folder: Folder of the files that it names; None for the working directory.
        others: Tables for those that the text lacks, as read from TOML.

    Raises:
        RigError: Lists every fault.
    """
    document = {**others, **read_toml(text, origin, RigError)}
    for old in rename_keys(document):
        name = RENAMED_KEYS[old].rpartition(".")[2]
        _LOG.warning("%s: %s", origin, at_line(line_of(text, old), f"rename {old} to {name}"))
    origins = Origins()
    values = origins.split(document)
    found = [*origins.faults, *read_files(values, folder or Path())]
    ranges, range_faults = assumed_ranges(origins.assumed, values)
    faults = [at_line(line_of(text, key), f"{key}: {fault}") for key, fault in found + range_faults]
    rig = _validated(values, origin, faults, text)
    return rig.model_copy(update={"assumed": ranges, "sources": origins.sources})


def _validated(values: Any, origin: str, faults: Sequence[str] = (), text: str = "") -> Rig:
    """Return the rig of a document, or raise its faults together with those already found."""
    try:
        rig = Rig.model_validate(values)
    except ValidationError as error:
        found = [*validation_faults(error, Rig, text), *faults]
        raise RigError(fault_list(origin, found)) from error
    if faults:
        raise RigError(fault_list(origin, list(faults)))
    return rig


def with_values(rig: Rig, values: Mapping[str, Any]) -> Rig:
    """Return the rig with some values replaced and validated.

    Args:
        values: TOML values by dotted key: ``{"press.jack_speed": "0.1 m/s"}``; a list
            entry is named by its index: ``"daq.channels.0.delay"``.

    Raises:
        RigError: A key does not exist, or the new rig is not valid.
    """
    document = rig_document(rig)
    faults = []
    for dotted, value in values.items():
        *parents, last = current_key(dotted).split(".")
        node: Any = document
        try:
            for part in parents:
                node = node[int(part)] if isinstance(node, list) else node[part]
            if not isinstance(node, dict) or last not in node or isinstance(node[last], dict):
                raise KeyError(last)
        except (KeyError, IndexError, ValueError, TypeError):
            faults.append(f"{dotted}: unknown quantity{near_miss(dotted, list(model_keys(Rig)))}")
            continue
        node[last] = value
    changed = _validated(document, f"rig {rig.name}", faults)
    kept = {"assumed": rig.assumed, "sources": rig.sources, "daq_only": rig.daq_only}
    return changed.model_copy(update=kept)


def rig_document(rig: BaseModel) -> dict[str, Any]:
    """Return a rig, or a table of one, as TOML holds it: quantities that read back exactly."""
    return _document(rig, type(rig))


def rig_json(rig: Rig) -> str:
    """Return the resolved rig as JSON text, for a recording's metadata."""
    stored = {"values": rig_document(rig), "assumed": rig.assumed, "sources": rig.sources}
    return json.dumps(stored | ({"daq_only": True} if rig.daq_only else {}))


@lru_cache(maxsize=8)
def rig_from_json(text: str) -> Rig:
    """Read back what `rig_json` wrote, also in earlier versions.

    The result is cached, since the recordings of a session share their rig.

    Raises:
        RigError: The text is not what `rig_json` writes.
    """
    origin = "the rig stored here cannot be read"
    try:
        stored = json.loads(text)
        values = stored["values"]
        rename_keys(values)
        for choir in (values, *values.get("more_choirs", ())):
            # The overlaps of earlier versions were those of a string on the mid-line.
            choir["plectrum"].setdefault("contact", "mid-line")
        origins = {
            name: {current_key(key): about for key, about in stored[name].items()}
            for name in ("assumed", "sources")
        }
        alone = {"daq_only": True} if stored.get("daq_only") is True else {}
        return _validated(values | origins | alone, origin)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise RigError(
            f"{origin}: {type(error).__name__}: {error}; only text written by rig_json can be read"
        ) from error


def read_toml(text: str, origin: str, error_type: type[Exception]) -> dict[str, Any]:
    """Parse TOML; ``error_type`` is raised with the line of the fault.

    Tables are nested at most `DEEPEST` deep, so that whoever uses them may recurse.
    """
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise error_type(f"{origin}: not valid TOML: {error}; correct that line") from error
    except ValueError as error:
        most = sys.get_int_max_str_digits()
        raise error_type(f"{origin}: a number has over {most} digits; shorten it") from error
    except RecursionError as error:
        raise error_type(f"{origin}: {_TOO_DEEP}") from error
    level: list[Any] = [document]
    for _ in range(DEEPEST):
        level = [inner for node in level for inner in _inside(node)]
    if level:
        raise error_type(f"{origin}: {_TOO_DEEP}")
    return document


def _inside(node: Any) -> Iterable[Any]:
    """Return what is directly inside a table or an array."""
    return node.values() if isinstance(node, dict) else node if isinstance(node, list) else ()


def current_document(document: dict[str, Any]) -> dict[str, Any]:
    """Return a document of an earlier version with the current keys, new ones at their defaults.

    Args:
        document: As `rig_document` returned it, or a part of it; left unchanged.
    """
    current = copy.deepcopy(document)
    rename_keys(current)
    _complete(current, Rig)
    return current


def _complete(document: dict[str, Any], kind: type[BaseModel]) -> None:
    """Add the optional keys that are missing in the tables of a document, in place."""
    for name, known in kind.model_fields.items():
        if name in document:
            value = document[name]
            for table in value if isinstance(value, list) else [value]:
                if isinstance(table, dict) and (nested := submodel(known.annotation)):
                    _complete(table, nested)
        elif not known.is_required() and not known.exclude:
            default = known.get_default(call_default_factory=True)
            document[name] = _plain(default, unit_of(kind, [name]))


def _document(model: BaseModel, kind: type[BaseModel]) -> dict[str, Any]:
    document: dict[str, Any] = {}
    for name, known in kind.model_fields.items():
        if not known.exclude:
            document[name] = _plain(getattr(model, name), unit_of(kind, [name], model))
    return document


def _plain(value: Any, unit: str | None) -> Any:
    if isinstance(value, BaseModel):
        return _document(value, type(value))
    if isinstance(value, tuple):
        return [_plain(item, unit) for item in value]
    if isinstance(value, float) and unit is not None:
        return format_quantity(value, unit)
    if value is None or isinstance(value, str | int | float):
        return value
    return str(value)


def read_files(values: dict[str, Any], folder: Path) -> list[tuple[str, str]]:
    """Replace the names of files by their contents; return the faults in them."""
    faults: list[tuple[str, str]] = []
    press = values.get("press")
    gesture = press.get("gesture") if isinstance(press, dict) else None
    if isinstance(press, dict) and isinstance(gesture, dict) and set(gesture) == {"file"}:
        try:
            press["gesture"] = read_gesture(folder / str(gesture["file"]))
        except RigError as error:
            del press["gesture"]
            faults.append(("press.gesture", str(error)))
    choirs = values.get("more_choirs")
    holders = [("", values)]
    if isinstance(choirs, list):
        holders += [(f"more_choirs.{i}.", c) for i, c in enumerate(choirs) if isinstance(c, dict)]
    for prefix, holder in holders:
        plectrum = holder.get("plectrum")
        outline = plectrum.get("outline") if isinstance(plectrum, dict) else None
        if isinstance(plectrum, dict) and isinstance(outline, dict) and "file" in outline:
            from sautereau.rig.outline import read_outline  # imports numpy; few rigs need it

            try:
                plectrum["outline"] = read_outline(outline, folder)
            except RigError as error:
                del plectrum["outline"]
                faults.append((f"{prefix}plectrum.outline", str(error)))
    return faults


_ORIGIN = ("assumed", "source")
_ORIGINS = {"assumed", "sources"}


@dataclass(frozen=True)
class Origins:
    """What a rig file says about its values, by dotted key."""

    assumed: dict[str, tuple[Any, Any]] = field(default_factory=dict)
    """A value and its assumed range."""
    sources: dict[str, str] = field(default_factory=dict)
    faults: list[tuple[str, str]] = field(default_factory=list)
    """Faults of these two, each after the key that it concerns."""

    def split(self, document: dict[str, Any]) -> dict[str, Any]:
        """Return the values of a document alone, and keep the rest here."""
        values = self._values(document, ())
        for name in _ORIGINS & set(values):
            del values[name]
            self.faults.append((name, "unknown key; write it into the table of each quantity"))
        if "daq_only" in values:
            fault = "unknown key; a recording of a rig with [daq] alone has it"
            self.faults.append(("daq_only", fault))
        return values

    def _values(self, node: Any, path: tuple[str, ...]) -> Any:
        if isinstance(node, list):
            return [self._values(value, (*path, str(i))) for i, value in enumerate(node)]
        if not isinstance(node, dict):
            return node
        if not path or "value" not in node:
            return {key: self._values(value, (*path, key)) for key, value in node.items()}
        self._keep(".".join(path), node)
        return node["value"]

    def _keep(self, key: str, table: dict[str, Any]) -> None:
        for unknown in sorted(set(table) - {"value", *_ORIGIN}):
            known = near_miss(unknown, ["value", *_ORIGIN]).replace("the top level", "a quantity")
            self.faults.append((f"{key}.{unknown}", f"unknown key{known}"))
        if "assumed" in table:
            self.assumed[key] = (table["value"], table["assumed"])
        if "source" in table:
            source = self.sources[key] = table["source"]
            if not isinstance(source, str):
                self.faults.append((f"{key}.source", f"{shown(source)} is refused: give a text"))


def assumed_ranges(assumed: dict[str, tuple[Any, Any]], values: dict[str, Any]):
    """Return the assumed ranges [SI] by dotted key, and the faults in them."""
    known = set(model_keys(Rig))
    ranges: dict[str, tuple[float, float]] = {}
    faults: list[tuple[str, str]] = []
    for key, (value, pair) in assumed.items():
        if re.sub(r"\.\d+(?=\.|$)", "", key) not in known:
            continue  # the unknown key is reported elsewhere
        try:
            ranges[key] = _range(unit_of(Rig, key.split("."), values), value, pair)
        except ValueError as error:
            faults.append((key, str(error)))
    return ranges, faults


def _range(unit: str | None, value: Any, pair: Any) -> tuple[float, float]:
    if unit is None or isinstance(value, list):
        raise ValueError("only a single quantity with a unit has an assumed range; remove assumed")
    if not isinstance(pair, list) or len(pair) != 2 or not all(isinstance(p, str) for p in pair):
        raise ValueError(
            f"assumed range {shown(pair)} is refused: give the smallest and the largest quantity"
            f" in {unit}"
        )
    try:
        low, high = (parse_quantity(end, unit) for end in pair)
    except ValueError as error:
        raise ValueError(f"assumed range: {error}; give a quantity in {unit}") from error
    if not low <= high:
        raise ValueError(f"assumed range {shown(pair)} is empty; give the smallest value first")
    try:
        inside = low <= parse_quantity(value, unit) <= high
    except (ValueError, TypeError):  # the fault of the value itself is reported elsewhere
        return low, high
    if not inside:
        raise ValueError(
            f"{value!r} is outside its assumed range {pair[0]!r} to {pair[1]!r};"
            " change the value or widen the range"
        )
    return low, high
