"""Where the rigs of a session's presses differ."""

from collections.abc import Mapping
from typing import Any

from sautereau.rig.load import rig_document
from sautereau.rig.schema import Rig

_ADDRESSES = (("controller", "port"), ("daq", "address"))
"""Where devices are plugged in: no condition of a press."""


def values_of(rig: Rig) -> dict[str, Any]:
    """Return a rig's values by dotted key, without its addresses."""
    document = rig_document(rig)
    for section, name in _ADDRESSES:
        del document[section][name]
    return dict(_flat(document, ""))


def _flat(node: Any, at: str) -> list[tuple[str, Any]]:
    if isinstance(node, Mapping) and node:
        parts = node.items()
    elif isinstance(node, list) and node and isinstance(node[0], Mapping):
        parts = enumerate(node)
    else:
        return [(at, node)]
    dot = f"{at}." if at else ""
    return [pair for key, value in parts for pair in _flat(value, f"{dot}{key}")]
