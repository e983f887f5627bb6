"""Read a rig file, report all its faults at once, and write a rig back."""

import json
import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from rig.errors import RigError
from rig.faults import fault_list, model_keys, near_miss, unit_of, validation_faults
from rig.schema import Rig
from rig.units import format_quantity, parse_quantity

_ORIGIN = {"value", "assumed", "source"}


def load_rig(name: str | Path = "paper") -> Rig:
    """Load a rig from a TOML file, or a packaged one by its name.

    Raises:
        RigError: Lists every fault of the file with its line, value, what is allowed.
    """
    path = Path(name)
    if path.suffix == ".toml" or path.is_file():
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise RigError(f"rig file {path}: cannot be read: {error}") from error
        return parse_rig(text, str(path))
    packaged = resources.files("rig").joinpath(f"{name}.toml")
    if not packaged.is_file():
        raise RigError(
            f"rig {str(name)!r} is neither a file nor a packaged rig"
            f" ({', '.join(packaged_rigs())}); give the path of a .toml file"
        )
    return parse_rig(packaged.read_text(encoding="utf-8"), f"packaged rig {name}")


def packaged_rigs() -> list[str]:
    """Return the names of the rigs that come with sautereau."""
    files = resources.files("rig").iterdir()
    return sorted(file.name[:-5] for file in files if file.name.endswith(".toml"))


def parse_rig(text: str, origin: str = "rig") -> Rig:
    """Build a rig from the text of a TOML file; ``origin`` names it in errors."""
    document = read_toml(text, origin, RigError)
    values, assumed, sources = _split_origins(document)
    faults = _range_faults(values, assumed)
    try:
        rig = Rig.model_validate(values)
    except ValidationError as error:
        faults = validation_faults(error, Rig, text) + faults
    if faults:
        raise RigError(fault_list(origin, faults))
    ranges = {key: _range(key, pair) for key, pair in assumed.items()}
    return rig.model_copy(update={"assumed": ranges, "sources": sources})


def with_values(rig: Rig, values: Mapping[str, Any]) -> Rig:
    """Return the rig with some values replaced, and validated anew.

    Args:
        rig: The rig to start from.
        values: TOML values by dotted key: ``{"press.jack_speed": "0.1 m/s"}``; a list
            entry is named by its index: ``"daq.channels.0.delay"``.

    Raises:
        RigError: A key does not exist, or the new rig is not valid.
    """
    document = rig_document(rig)
    faults = []
    for dotted, value in values.items():
        *parents, last = dotted.split(".")
        node: Any = document
        try:
            for part in parents:
                node = node[int(part)] if isinstance(node, list) else node[part]
            if not isinstance(node, dict) or last not in node or isinstance(node[last], dict):
                raise KeyError(last)
        except (KeyError, IndexError, ValueError, TypeError):
            faults.append(
                f"{dotted}: no such quantity in a rig{near_miss(dotted, list(model_keys(Rig)))}"
            )
            continue
        node[last] = value
    try:
        changed = Rig.model_validate(document)
    except ValidationError as error:
        faults += validation_faults(error, Rig, "")
    if faults:
        raise RigError(fault_list(f"rig {rig.name}", faults))
    return changed.model_copy(update={"assumed": rig.assumed, "sources": rig.sources})


def rig_document(rig: Rig) -> dict[str, Any]:
    """Return the rig as TOML would hold it, every value a quantity that reads back exactly."""
    return _document(rig, type(rig))


def rig_json(rig: Rig) -> str:
    """Return the resolved rig as JSON text, for a recording's metadata."""
    return json.dumps({"values": rig_document(rig), "assumed": rig.assumed, "sources": rig.sources})


def rig_from_json(text: str) -> Rig:
    """Read back what `rig_json` wrote."""
    try:
        saved = json.loads(text)
        rig = Rig.model_validate(saved["values"])
        assumed = {key: (float(low), float(high)) for key, (low, high) in saved["assumed"].items()}
        return rig.model_copy(update={"assumed": assumed, "sources": saved["sources"]})
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise RigError(f"the rig stored here cannot be read: {error}") from error


def read_toml(text: str, origin: str, error_type: type[Exception]) -> dict[str, Any]:
    """Parse TOML; ``error_type`` is raised with the place of the fault."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise error_type(f"{origin}: not valid TOML: {error}; mend that line") from error


def _split_origins(document: dict[str, Any]):
    """Part a document into plain values, assumed ranges and sources by dotted key."""
    assumed: dict[str, Any] = {}
    sources: dict[str, str] = {}

    def walk(node: Any, path: tuple[str, ...]) -> Any:
        if isinstance(node, dict):
            if "value" in node and set(node) <= _ORIGIN:
                if "assumed" in node:
                    assumed[".".join(path)] = node["assumed"]
                if "source" in node:
                    sources[".".join(path)] = str(node["source"])
                return node["value"]
            return {key: walk(value, (*path, key)) for key, value in node.items()}
        if isinstance(node, list):
            return [walk(value, (*path, str(i))) for i, value in enumerate(node)]
        return node

    return walk(document, ()), assumed, sources


def _range(key: str, pair: Any) -> tuple[float, float]:
    unit = unit_of(Rig, key.split("."))
    if unit is None or not isinstance(pair, list) or len(pair) != 2:
        raise ValueError(f"{pair!r} is refused: assumed holds the least and the largest quantity")
    low, high = (parse_quantity(str(end), unit) for end in pair)
    if not low <= high:
        raise ValueError(f"assumed range {pair!r} is empty; give the least value first")
    return low, high


def _range_faults(values: dict[str, Any], assumed: dict[str, Any]) -> list[str]:
    faults = []
    for key, pair in assumed.items():
        node: Any = values
        for part in key.split("."):
            node = node[int(part)] if isinstance(node, list) else node[part]
        try:
            low, high = _range(key, pair)
            value = parse_quantity(str(node), unit_of(Rig, key.split(".")) or "")
        except ValueError as error:
            faults.append(f"{key}: {error}")
            continue
        if not low <= value <= high:
            faults.append(
                f"{key}: {node!r} is outside its assumed range {pair[0]!r} to {pair[1]!r}"
            )
    return faults


def _document(model: BaseModel, kind: type[BaseModel]) -> dict[str, Any]:
    document: dict[str, Any] = {}
    for name in kind.model_fields:
        value = getattr(model, name)
        if kind is Rig and name in ("assumed", "sources"):
            continue
        unit = unit_of(kind, [name])
        document[name] = _plain(value, unit)
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
