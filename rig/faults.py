"""Say what is wrong with a TOML document: each fault with its line, key, value and remedy."""

import difflib
import re
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel, ValidationError

from rig.units import Unit


def fault_list(origin: str, faults: list[str]) -> str:
    """Return one message that holds every fault."""
    if len(faults) == 1:
        return f"{origin}: {faults[0]}"
    return f"{origin}: {len(faults)} faults\n" + "\n".join(f"  {fault}" for fault in faults)


def validation_faults(error: ValidationError, model: type[BaseModel], text: str) -> list[str]:
    """Turn pydantic's errors into lines: place, key, value, what is allowed, remedy."""
    faults = []
    for item in error.errors(include_url=False):
        location = [part for part in item["loc"] if part not in ("velocity", "force")]
        key = ".".join(map(str, location))
        line = _line_of(text, key)
        place = f"line {line}: " if line else ""
        prefix = f"{place}{key}: " if key else place
        value = item["input"]
        if item["type"] == "extra_forbidden":
            near = near_miss(key, list(model_keys(model)))
            faults.append(f"{prefix}unknown key{near or '; remove it'}")
        elif item["type"] == "missing":
            faults.append(f"{prefix}missing; add it")
        elif item["type"] == "value_error":
            faults += [f"{prefix}{fault}" for fault in str(item["ctx"]["error"]).split("\n")]
        elif item["type"] == "quantity" and isinstance(value, str):
            faults.append(f"{prefix}{item['msg']}")
        else:
            message = item["msg"][0].lower() + item["msg"][1:]
            unit = unit_of(model, location)
            faults.append(f"{prefix}{value!r} is refused: {message}{f' (in {unit})' * bool(unit)}")
    return faults


def near_miss(key: str, known: list[str]) -> str:
    """Return the end of a sentence that names the known key closest to a wrong one."""
    bare = re.sub(r"\.\d+(?=\.|$)", "", key)
    section, _, last = bare.rpartition(".")
    beside = [k.rpartition(".")[2] for k in known if k.rpartition(".")[0] == section]
    close = difflib.get_close_matches(last, beside, n=1)
    if close:
        return f"; did you mean {close[0]!r}?"
    elsewhere = [k for k in known if k.rpartition(".")[2] == last]
    if elsewhere:
        return f"; did you mean {elsewhere[0]!r}?"
    return f"; {section or 'a rig'} has {', '.join(sorted(set(beside)))}" if beside else ""


def _line_of(text: str, key: str) -> int | None:
    """Return the line that sets a dotted key, or that opens its nearest table."""
    best = None
    table: list[str] = []
    counts: dict[str, int] = {}
    wanted = key.split(".")
    for number, line in enumerate(text.splitlines(), 1):
        if header := re.match(r"\s*(\[\[?)\s*([\w.\-]+)\s*\]", line):
            table = header[2].split(".")
            if header[1] == "[[":
                counts[header[2]] = counts.get(header[2], -1) + 1
                table = [*table, str(counts[header[2]])]
            here = table
        elif entry := re.match(r"\s*([\w.\-]+)\s*=", line):
            here = [*table, *entry[1].split(".")]
        else:
            continue
        if wanted[: len(here)] == here and (best is None or len(here) > best[0]):
            best = (len(here), number)
    return best[1] if best else None


def _submodels(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    found = []
    for inner in getattr(annotation, "__args__", ()):
        found += _submodels(inner)
    return found


def unit_of(model: type[BaseModel], location: list[Any]) -> str | None:
    """Return the SI unit of the field at a location in a model, or None."""
    models = [model]
    unit = None
    for part in location:
        if str(part).isdigit():
            continue
        unit, following = None, []
        for candidate in models:
            if field := candidate.model_fields.get(str(part)):
                unit = unit or _find_unit(field.metadata) or _find_unit([field.annotation])
                following += _submodels(field.annotation)
        models = following
    return unit


def _find_unit(items: Any) -> str | None:
    for item in items:
        if isinstance(item, Unit):
            return item.name
        inner = [*getattr(item, "__metadata__", ()), *getattr(item, "__args__", ())]
        if not isinstance(item, type) and (found := _find_unit(inner)):
            return found
    return None


def model_keys(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """Yield every dotted key of a model, tables included."""
    for name, field in model.model_fields.items():
        yield prefix + name
        for inner in _submodels(field.annotation):
            yield from model_keys(inner, f"{prefix}{name}.")
