"""Rig keys that were renamed: files and recordings with the old keys are still read."""

from typing import Any

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
