"""Which values of two rigs make their presses differ."""

from collections.abc import Mapping
from typing import Any

from sautereau.rig.load import rig_document
from sautereau.rig.schema import Rig

_MAY_CHANGE = {
    "controller": ("port", "verified", "verified_settings", "verified_on"),
    "daq": ("address",),
}
"""What may change between equal presses: where the devices are connected, and that the controller
was verified again."""


def comparable(document: dict[str, Any]) -> dict[str, Any]:
    """Remove what may change within a session from a rig as TOML holds it, and return it."""
    for section, names in _MAY_CHANGE.items():
        for name in names:
            document.get(section, {}).pop(name, None)
    return document


def values_of(rig: Rig) -> dict[str, Any]:
    """Return the values of a rig by dotted key, without those that may change within a session."""
    return flat(comparable(rig_document(rig)))


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
