"""Values of a rig by short names and in any form, as programs write them."""

from collections.abc import Mapping
from numbers import Real
from typing import Any

from sautereau.rig.errors import RigError
from sautereau.rig.faults import fault_list, model_keys, near_miss, unit_of
from sautereau.rig.schema import Rig

_LISTS = ("more_choirs.", "daq.channels.")


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
    raise RigError(f"{name}: unknown quantity{near_miss(name, list(keys))}")


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


RENAMED_KEYS = {"key.front_heaviness": "key.gravity_moment"}
"""Current dotted key of each key of an earlier version, in the same table."""


def current_key(key: str) -> str:
    """Return the current name of a dotted key."""
    return RENAMED_KEYS.get(key, key)


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
