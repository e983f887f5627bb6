"""Where the values of a rig file come from: their sources, and the ranges that were assumed."""

import re
from dataclasses import dataclass, field
from typing import Any

from sautereau.rig.faults import model_keys, near_miss, unit_of
from sautereau.rig.schema import Rig
from sautereau.rig.units import parse_quantity, shown

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
