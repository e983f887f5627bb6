"""Reference of a TOML file: every key with unit, default, limits and meaning."""

import ast
import inspect
import json
import re
import textwrap
import types
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import date
from functools import cache
from itertools import pairwise
from typing import Annotated, Any, Literal, Union, cast, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from sautereau.rig.faults import submodel, unit_of
from sautereau.rig.registry import NameIn
from sautereau.rig.schema import Rig
from sautereau.rig.section import Section
from sautereau.rig.units import format_quantity

_KINDS = {
    str: "text",
    int: "integer",
    bool: "true or false",
    date: "date",
    float: "number",
    dict: "table",
}
_SIGNS = (("gt", "> "), ("ge", ">= "), ("lt", "< "), ("le", "<= "))


@dataclass(frozen=True)
class KeyDescription:
    """One key of a table."""

    name: str
    """Name of the key in its table."""
    unit: str
    """SI unit as people write it; empty if there is none."""
    kind: str
    """Kind of value: quantity, integer, text, one of several words."""
    default: str | None
    """Default as TOML writes it; empty if the key is optional, None if it is required."""
    limits: str
    """Limits of the value, in `unit`; empty if there are none."""
    meaning: str
    """The field's docstring without its unit."""


@dataclass(frozen=True)
class TableDescription:
    """One table of the file."""

    name: str
    """Dotted name; empty for the top level."""
    repeated: bool
    """Whether it is an array of tables, ``[[name]]``."""
    needed: bool
    """Whether a file must have it."""
    meaning: str
    """What it describes."""
    entries: tuple[KeyDescription, ...]


def describe(model: type[BaseModel] = Rig) -> list[TableDescription]:
    """Return every table that a file of a model may have, in the file's order."""
    return list(_tables(model, "", "", repeated=False, needed=True))


def _tables(
    model: type[BaseModel], name: str, text: str, *, repeated: bool, needed: bool
) -> Iterator[TableDescription]:
    fields = {key: field for key, field in model.model_fields.items() if not field.exclude}
    inner = {key: found for key, field in fields.items() if (found := submodel(field.annotation))}
    entries = tuple(_entry(key, model) for key in fields if key not in inner)
    yield TableDescription(name, repeated, needed, _prose(f"{_class_text(model)} {text}"), entries)
    for key, found in inner.items():
        many = get_origin(_bare(fields[key].annotation)) is tuple
        dotted = f"{name}.{key}" if name else key
        of_field, needed = _docstrings(model).get(key, ""), fields[key].is_required()
        yield from _tables(found, dotted, of_field, repeated=many, needed=needed)


def _class_text(model: type[BaseModel]) -> str:
    """Return the docstring of a table's class; empty if several tables share the class."""
    shared = model is Section or model.__name__.startswith("_")
    return "" if shared else model.__doc__ or ""


def _entry(key: str, model: type[BaseModel]) -> KeyDescription:
    field, name = model.model_fields[key], unit_of(model, [key])
    unit = _written(name) if name else ""
    meaning = _prose(_docstrings(model).get(key, ""))
    for head in (f"{unit or '1'}, ", f"{unit or '1'}.", f"{unit} "):
        if head != " " and meaning.startswith(head):
            meaning = meaning.removeprefix(head)
            break
    return KeyDescription(
        key, unit, _kind(field, name), _default(field, name), _limits(field), meaning
    )


@cache
def _docstrings(model: type[BaseModel]) -> dict[str, str]:
    """Return the fields' docstrings.

    Pydantic could read them as the models are made, which would slow the start of every command.
    """
    found: dict[str, str] = {}
    for kind in reversed(model.__mro__):
        if not issubclass(kind, BaseModel) or kind is BaseModel:
            continue
        (tree,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
        for field, text in pairwise(cast(ast.ClassDef, tree).body):
            match field, text:
                case (
                    ast.AnnAssign(target=ast.Name(id=name)),
                    ast.Expr(value=ast.Constant(value=str(docstring))),
                ):
                    found[name] = inspect.cleandoc(docstring)
    return found


def _written(unit: str) -> str:
    """Return a unit as people write it: kg m^2 for pint's kg*m**2."""
    return unit.replace("**", "^").replace("*", " ")


def _bare(annotation: Any) -> Any:
    """Return an annotation without its metadata and without an alternative None."""
    if get_origin(annotation) is Annotated:
        return _bare(get_args(annotation)[0])
    if get_origin(annotation) in (Union, types.UnionType):
        others = [inner for inner in get_args(annotation) if inner is not type(None)]
        return _bare(others[0])
    return annotation


def _kind(field: FieldInfo, unit: str | None) -> str:
    registries = [item.registry for item in field.metadata if isinstance(item, NameIn)]
    if registries:
        return "one of " + ", ".join(registries[0].names())
    return _kind_of(field.annotation, unit)


def _kind_of(annotation: Any, unit: str | None) -> str:
    bare = _bare(annotation)
    if get_origin(bare) is Literal:
        return "one of " + ", ".join(map(str, get_args(bare)))
    if get_origin(bare) is tuple:
        items = get_args(bare)
        many = "list" if Ellipsis in items else f"list of {len(items)}"
        return f"{many}: {_kind_of(items[0], unit)}"
    return "quantity" if unit else _KINDS[get_origin(bare) or bare]


def _default(field: FieldInfo, unit: str | None) -> str | None:
    if field.is_required():
        return None
    value = field.get_default(call_default_factory=True)
    return "" if value in (None, (), {}) else _toml(value, unit)


def _toml(value: Any, unit: str | None) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(_toml(item, unit) for item in value)}]"
    if isinstance(value, float) and unit:
        return json.dumps(format_quantity(value, _written(unit)))
    return json.dumps(value)


def _limits(field: FieldInfo) -> str:
    items = [*field.metadata, *_inner_metadata(field.annotation)]
    found = {
        sign: f"{sign}{getattr(item, name):g}"
        for item in items
        for name, sign in _SIGNS
        if getattr(item, name, None) is not None
    }
    return ", ".join(found.values())


def _inner_metadata(annotation: Any) -> Iterator[Any]:
    for inner in get_args(annotation):
        for item in getattr(inner, "__metadata__", ()):
            yield from getattr(item, "metadata", None) or [item]


def _prose(docstring: str) -> str:
    """Return a docstring on one line, in Markdown."""
    return re.sub(r"\s+", " ", docstring).strip().replace("``", "`")
