"""A rig as a document, as TOML and JSON hold it: of this version and of earlier ones."""

import copy
import json
import re
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from numbers import Real
from typing import Any

from pydantic import BaseModel, ValidationError

from sautereau.rig.errors import RigError
from sautereau.rig.faults import (
    Place,
    fault_list,
    model_keys,
    near_miss,
    submodel,
    unit_of,
    validation_faults,
)
from sautereau.rig.schema import Rig
from sautereau.rig.units import format_quantity

RENAMED_KEYS = {"key.front_heaviness": "key.gravity_moment"}
"""Current dotted key of each key of an earlier version, in the same table."""
_LISTS = ("more_choirs.", "daq.channels.")
_MAY_CHANGE = {
    "controller": ("port", "verified", "verified_settings", "verified_on"),
    "daq": ("address",),
}
"""What may change between equal presses: where the devices are connected, and that the controller
was verified again."""


def rig_document(rig: BaseModel) -> dict[str, Any]:
    """Return a rig, or a table of one, as TOML holds it: quantities that read back exactly."""
    return {
        name: _plain(getattr(rig, name), unit_of(type(rig), [name], rig))
        for name, known in type(rig).model_fields.items()
        if not known.exclude
    }


def _plain(value: Any, unit: str | None) -> Any:
    if isinstance(value, BaseModel):
        return rig_document(value)
    if isinstance(value, tuple):
        return [_plain(item, unit) for item in value]
    if isinstance(value, float) and unit is not None:
        return format_quantity(value, unit)
    if value is None or isinstance(value, str | int | float):
        return value
    return str(value)


def validated(
    values: Any,
    origin: str,
    faults: Sequence[str] = (),
    place: Callable[[str], Place] | None = None,
) -> Rig:
    """Return the rig of a document, or raise its faults together with those already found.

    Args:
        place: Of the value of a dotted key; None if there is no text.
    """
    try:
        rig = Rig.model_validate(values)
    except ValidationError as error:
        found = [*validation_faults(error, Rig, place), *faults]
        raise RigError(fault_list(origin, found)) from error
    if faults:
        raise RigError(fault_list(origin, list(faults)))
    return rig


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
        return validated(values | origins | alone, origin)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise RigError(
            f"{origin}: {type(error).__name__}: {error}; only text written by rig_json can be read"
        ) from error


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


def rename_keys(document: dict[str, Any]) -> list[str]:
    """Give the old keys of a rig's document their current names, in place.

    Args:
        document: A rig as TOML or JSON holds it. A table that has both names of a key keeps
            both, and the old one is refused as unknown.

    Returns:
        The old keys found.
    """
    found = []
    for old, new in RENAMED_KEYS.items():
        *parents, old_name = old.split(".")
        name = new.rpartition(".")[2]
        table: Any = document
        for part in parents:
            table = table.get(part) if isinstance(table, dict) else None
        if isinstance(table, dict) and old_name in table and name not in table:
            table[name] = table.pop(old_name)
            found.append(old)
    return found


def current_key(key: str) -> str:
    """Return the current name of a dotted key, which may start with the number of a string.

    `string2.plectrum.overlap` is `more_choirs.0.plectrum.overlap`.
    """
    if found := re.fullmatch(r"string([1-9]\d*)\.(.+)", key):
        number, key = int(found[1]), found[2]
        key = key if number == 1 else f"more_choirs.{number - 2}.{key}"
    return RENAMED_KEYS.get(key, key)


def named_values(values: Mapping[str, Any] | None, named: Mapping[str, Any]) -> dict[str, Any]:
    """Return values by dotted key, numbers as quantities in their SI unit.

    Args:
        values: By dotted key or by short name.

    Raises:
        RigError: Lists every name that is unknown or ambiguous.
    """
    found, faults = {}, []
    for name, value in {**(values or {}), **named}.items():
        try:
            key = full_key(name)
        except RigError as error:
            faults.append(str(error))
            continue
        unit = unit_of(Rig, key.split("."))
        number = isinstance(value, Real) and not isinstance(value, bool)
        found[key] = f"{float(value)!r} {unit}" if unit and number else value
    if faults:
        raise RigError(fault_list("values", faults))
    return found


def full_key(name: str) -> str:
    """Return the dotted key of a name: `overlap` is `plectrum.overlap`.

    Args:
        name: A dotted key, or the last part of one where only one key ends in it.

    Raises:
        RigError: No key ends in it, or several do.
    """
    if "." in name:
        return current_key(name)
    keys = [key for key in model_keys(Rig) if not key.startswith(_LISTS)]
    found = [key for key in keys if key.rpartition(".")[2] == name and "." in key]
    if len(found) == 1:
        return found[0]
    if found:
        raise RigError(f"{name}: it may be {' or '.join(found)}; give the dotted key")
    last = [key.rpartition(".")[2] for key in keys]
    raise RigError(f"{name}: unknown quantity{near_miss(name, last)}")


def typed_value(key: str, text: str) -> Any:
    """Return a cell of a table as TOML would hold it: quantities are texts, bare numbers are not.

    Args:
        key: Dotted key of the value.
    """
    if unit_of(Rig, key.split(".")) is None:
        for kind in (int, float):
            try:
                return kind(text)
            except ValueError:
                continue
    return text


def values_of(rig: Rig) -> dict[str, Any]:
    """Return the values of a rig by dotted key, without those that may change within a session."""
    return flat(comparable(rig_document(rig)))


def comparable(document: dict[str, Any]) -> dict[str, Any]:
    """Remove what may change within a session from a rig as TOML holds it, and return it."""
    for section, names in _MAY_CHANGE.items():
        for name in names:
            document.get(section, {}).pop(name, None)
    return document


def flat(node: Any, at: str = "") -> dict[str, Any]:
    """Return the values of a document by dotted key; entries of lists are named by their index."""
    if isinstance(node, Mapping) and node:
        parts = node.items()
    elif isinstance(node, list) and node and isinstance(node[0], Mapping):
        parts = enumerate(node)
    else:
        return {at: node}
    dot = f"{at}." if at else ""
    return {k: v for key, value in parts for k, v in flat(value, f"{dot}{key}").items()}
