"""Faults of a TOML document: each with its line, key and value, and how to fix it."""

import difflib
import json
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple, get_args

from pydantic import BaseModel, ValidationError

from sautereau.rig.disk import named_text
from sautereau.rig.errors import RigError
from sautereau.rig.units import Unit, UnitBy, parse_quantity, readable_quantity, shown

MOST_FAULTS = 50
"""Faults that are listed one by one; the time for finding each line grows with the file."""


class Place(NamedTuple):
    """Where a value stands, ordered as faults are listed."""

    order: int = 0
    """Of the file: 0 for the one that the message names first."""
    line: int = 0
    """Line of the text; 0 if it has none."""
    file: str = ""
    """Name of the file; empty for the one that the message names first."""

    def said(self, fault: str) -> str:
        """Return a fault after its place, if that is known."""
        parts = [self.file, f"line {self.line}" if self.line else ""]
        where = ", ".join(filter(None, parts))
        return f"{where}: {fault}" if where else fault


@dataclass(frozen=True)
class Condition:
    """One value of a document, without which another one has no effect."""

    key: str
    """Its dotted key."""
    values: tuple[object, ...] = ()
    """Those with which the other acts, the first of which is suggested; empty for all but `but`."""
    but: tuple[object, ...] = (None, 0, "", (0.0, 0.0))

    def holds(self, document: object) -> bool:
        """Return whether a document, a table or a namespace of tables, has such a value."""
        for part in self.key.split("."):
            document = getattr(document, part, None)
        return document in self.values if self.values else document not in self.but

    def __str__(self) -> str:
        if self.values:
            return f"{self.key} = {json.dumps(self.values[0])}"
        return (
            f"{self.key} other than {json.dumps(self.but[0])}" if len(self.but) == 1 else self.key
        )


ActsIf = Mapping[str, tuple[Condition, ...]]
"""By the beginning of a value in TOML, `key = value`, the conditions of which one must hold."""


def lacking(conditions: tuple[Condition, ...], document: object) -> str:
    """Return why a value has no effect and how to fix it; empty if a condition holds."""
    if any(one.holds(document) for one in conditions):
        return ""
    needed = " or ".join(map(str, conditions))
    return f"it has no effect without {needed}; set that, or remove it"


def without_effect(
    given: Mapping[str, object], acts_if: ActsIf, document: object
) -> Iterator[tuple[str, str]]:
    """Yield the keys of values that have no effect, each with the reason and how to fix it.

    Args:
        given: Values by dotted key.
        document: With the values of the conditions.
    """
    for key, value in given.items():
        text = f"{key} = {json.dumps(value, default=str)}"
        for start, conditions in acts_if.items():
            if text.startswith(start) and (why := lacking(conditions, document)):
                yield key, why
                break


def in_text(text: str) -> Callable[[str], Place]:
    """Return a function that finds the place of a dotted key in a text."""
    return lambda key: Place(line=line_of(text, key) or 0)


def fault_list(origin: str, faults: list[str]) -> str:
    """Return one message that holds every fault."""
    if len(faults) == 1:
        return f"{origin}: {faults[0]}"
    return f"{origin}: {len(faults)} faults\n" + "\n".join(f"  {fault}" for fault in faults)


@contextmanager
def validating(
    model: type[BaseModel],
    error_type: type[Exception],
    origin: str,
    place: Callable[[str], Place] | None = None,
    fix: str = "",
) -> Iterator[None]:
    """Report all faults of what is validated in the block, and how to fix them; see below.

    Raises:
        Exception: An ``error_type``.
    """
    try:
        yield
    except ValidationError as error:
        listed = fault_list(origin, validation_faults(error, model, place))
        raise error_type(f"{listed}\n{fix}".strip()) from error


def first_fault(error: ValidationError) -> str:
    """Return the place and the message of the first fault of a JSON file."""
    first = error.errors(include_url=False, include_input=False)[0]
    return f"{'.'.join(map(str, first['loc'])) or 'the file'}: {first['msg']}"


def validation_faults(
    error: ValidationError, model: type[BaseModel], place: Callable[[str], Place] | None = None
) -> list[str]:
    """Turn pydantic's errors into lines: line of the file, key, value, limit, how to fix it.

    Args:
        place: Of the value of a dotted key; None if there is no text.
    """
    place, faults = place or in_text(""), []
    errors = error.errors(include_url=False)
    refused = {item["loc"][:n] for item in errors for n in range(len(item["loc"]))}
    for item in errors[:MOST_FAULTS]:
        location = list(item["loc"])
        if item["type"] == "too_short" and item["loc"] in refused:
            continue  # pydantic counts the entries that it accepts
        key = ".".join(map(str, location))
        if item["type"] == "value_error":
            for fault in str(item.get("ctx", {})["error"]).split("\n"):
                named = ".".join(filter(None, (key, fault.partition(":")[0])))
                between = "." if bare_key(named) in model_keys(model) else ": "
                faults.append((place(named), f"{key}{between * bool(key)}{fault}"))
        else:
            message = _message(item, model, location)
            faults.append((place(key), f"{key}: {message}" if key else message))
    faults.sort(key=lambda fault: fault[0])
    listed = [where.said(fault) for where, fault in faults]
    more = len(errors) - MOST_FAULTS
    return [*listed, f"and {more} more faults"] if more > 0 else listed


def _message(item: Any, model: type[BaseModel], location: list[int | str]) -> str:
    """Return what is wrong at one location, and what is allowed."""
    kind, value = item["type"], item["input"]
    if kind == "extra_forbidden":
        key = ".".join(map(str, location))
        return f"unknown key{near_miss(key, list(model_keys(model))) or '; remove it'}"
    if kind == "missing":
        return "missing; add it"
    if kind == "quantity":
        given = item["ctx"]
        example = _example(model, location, given["unit"]) or given["example"]
        return f'{given["fault"]}; give a quantity in {given["unit"]} such as "{example}"'
    if kind == "unknown_name":
        return item["msg"]
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return f"{shown(value)} is refused; give a table"
    if kind == "tuple_type":
        return f"{shown(value)} is refused; give an array"
    unit = f" {unit_of(model, location) or ''}".rstrip()
    message = item["msg"][0].lower() + item["msg"][1:]
    if isinstance(value, str):  # an optional quantity, with its own unit; the limit has SI's
        return f"{shown(value)} is refused: {message}{unit}"
    return f"{shown(value)}{unit * isinstance(value, float)} is refused: {message}"


def _example(model: type[BaseModel], location: list[int | str], unit: str) -> str:
    """Return what the packaged rig has in a field, or its default; empty for neither."""
    parts = list(map(str, location))
    names = [part for part in parts if not part.isdigit()]
    for full in (parts, names):
        for start in range(len(full)):  # a further string has the fields of the first
            text = _packaged().get(".".join(full[start:]), "")
            with suppress(ValueError):  # another table's
                if parse_quantity(text, unit):
                    return text
    table: type[BaseModel] | None = model
    for name in names[:-1]:
        table = _declared(table, name)[1] if table else None
    field = table.model_fields.get(names[-1]) if table else None
    default = field.default if field else None
    return readable_quantity(default, unit) if isinstance(default, float) and default else ""


@cache
def _packaged() -> dict[str, str]:
    """Return the quantities of the packaged rig as it writes them, by dotted key."""
    text, *_ = named_text("paper", "sautereau.rig", "rig", RigError)
    found: dict[str, str] = {}

    def take(node: Any, key: str) -> None:
        if isinstance(node, str):
            found.setdefault(key, node)
        elif isinstance(node, list):
            for number, one in enumerate(node):
                take(one, f"{key}.{number}")
                take(one, key)
        elif isinstance(node, dict):
            for name, one in node.items():
                take(one, key if name == "value" else f"{key}.{name}".lstrip("."))

    take(tomllib.loads(text), "")
    return found


def bare_key(key: str) -> str:
    """Return a dotted key without the indices of lists."""
    return re.sub(r"\.\d+(?=\.|$)", "", key)


def near_miss(key: str, known: list[str]) -> str:
    """Return the end of a message that suggests the known key most similar to a wrong one."""
    bare = bare_key(key)
    section, _, last = bare.rpartition(".")
    same_table = [k.rpartition(".")[2] for k in known if k.rpartition(".")[0] == section]
    if close := difflib.get_close_matches(last, same_table, n=1):
        return f"; did you mean {close[0]!r}?"
    elsewhere = [k for k in known if k.rpartition(".")[2] == last]
    if elsewhere:
        return f"; did you mean {elsewhere[0]!r}?"
    if 0 < len(same_table) <= 16:  # More are not read
        return f"; {section or 'the top level'} has {', '.join(sorted(set(same_table)))}"
    if same_table:
        return f"; `sautereau init` writes a file with all keys of {section or 'the top level'}"
    return near_miss(section, known) if section else ""


def line_of(text: str, key: str) -> int | None:
    """Return the line that sets a dotted key, or that opens its nearest table."""
    best = None
    table: list[str] = []
    counts: dict[str, int] = {}
    parts = key.split(".")
    for number, line in enumerate(text.split("\n"), 1):
        if header := re.match(r"\s*(\[\[?)\s*([\w.\-]+)\s*\]", line):
            if header[1] == "[[":
                counts[header[2]] = counts.get(header[2], -1) + 1
            table, name = [], ""
            for part in header[2].split("."):  # an array's inner tables are those of its last entry
                name = f"{name}.{part}".lstrip(".")
                table += [part, str(counts[name])] if name in counts else [part]
            here = table
        elif entry := re.match(r"\s*([\w.\-]+)\s*=", line):
            here = [*table, *entry[1].split(".")]
        else:
            continue
        if parts[: len(here)] == here and (best is None or len(here) > best[0]):
            best = (len(here), number)
    return best[1] if best else None


def submodel(annotation: Any) -> type[BaseModel] | None:
    """Return the table that an annotation allows; None if it is a value."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(submodel, get_args(annotation))), None)


def unit_of(model: type[BaseModel], location: list[Any], values: Any = None) -> str | None:
    """Return the SI unit of the field at a location in a model, or None.

    Args:
        model: The table to begin with.
        location: Names of fields, and indices of lists.
        values: What the table holds, a document or an instance. Where a unit follows from
            another field and there is no such value, the result names all: `m/s/V or N/V`.
    """
    table: type[BaseModel] | None = model
    unit = None
    for part in location:
        if str(part).isdigit():
            values = values[int(part)] if isinstance(values, list | tuple) else None
            continue
        unit, inner = _declared(table, str(part)) if table else (None, None)
        if isinstance(unit, UnitBy) and (name := _value(values, unit.field)) in unit.names():
            unit = unit.unit(name)
        table, values = inner, _value(values, str(part))
    return unit.name if unit else None


@cache
def _declared(
    table: type[BaseModel], name: str
) -> tuple[Unit | UnitBy | None, type[BaseModel] | None]:
    """Return the unit of a field of a table, and the table that it allows; None without them."""
    field = table.model_fields.get(name)
    if field is None:
        return None, None
    unit = _find_unit(field.metadata) or _find_unit([field.annotation])
    return unit, submodel(field.annotation)


def _value(values: Any, name: str) -> Any:
    return values.get(name) if isinstance(values, dict) else getattr(values, name, None)


def _find_unit(items: Any) -> Unit | UnitBy | None:
    for item in items:
        if isinstance(item, Unit | UnitBy):
            return item
        inner = [*getattr(item, "__metadata__", ()), *getattr(item, "__args__", ())]
        if not isinstance(item, type) and (found := _find_unit(inner)):
            return found
    return None


def model_keys(model: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """Yield every dotted key that a file may set, tables included."""
    for name, field in model.model_fields.items():
        if field.exclude:
            continue
        yield prefix + name
        if inner := submodel(field.annotation):
            yield from model_keys(inner, f"{prefix}{name}.")
