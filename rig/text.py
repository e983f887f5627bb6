"""A rig as the text of a rig file: with its values' origins, or commented, to start from."""

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
from pathlib import Path
from typing import Annotated, Any, Literal, Union, cast, get_args, get_origin

import tomlkit
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from tomlkit.items import Table

from sautereau.rig.disk import named_text
from sautereau.rig.document import rig_document
from sautereau.rig.errors import RigError
from sautereau.rig.faults import submodel, unit_of
from sautereau.rig.layers import Layers
from sautereau.rig.registry import NameIn
from sautereau.rig.schema import Rig
from sautereau.rig.units import Section, format_quantity

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
    # Several tables may share a class, which then says nothing about one of them.
    shared = model is Section or model.__name__.startswith("_")
    about = _prose(f"{'' if shared else model.__doc__ or ''} {text}")
    yield TableDescription(name, repeated, needed, about, entries)
    for key, found in inner.items():
        many = get_origin(_bare(fields[key].annotation)) is tuple
        dotted = f"{name}.{key}" if name else key
        of_field, needed = _docstrings(model).get(key, ""), fields[key].is_required()
        yield from _tables(found, dotted, of_field, repeated=many, needed=needed)


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


_ALIKE = "more_choirs"  # Table with the same inner tables as the first choir
PARTS = {
    "instrument": ("key", "jack", "plectrum", "string"),
    "bench": ("press", "arm", "controller", "daq"),
}
"""Tables of the two parts of a rig, which may stand in files of their own."""


def rig_text(rig: Rig) -> str:
    """Return a rig as TOML that `rig.load.parse_rig` reads back: values, ranges and sources.

    It has none of the comments of the original file, and includes the content of files that the
    original named.
    """
    document = tomlkit.document()
    plain: dict[str, Any] = {}
    for name, value in rig_document(rig).items():
        _add(document if not isinstance(value, dict) else plain, name, value, rig, name)
    document.update(plain)
    return tomlkit.dumps(document)


def _add(holder: Any, name: str, value: Any, rig: Rig, dotted: str) -> None:
    """Put a value into a table of the document; None is omitted."""
    if value is None:
        return
    if isinstance(value, dict):
        holder[name] = _table(value, rig, dotted)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        tables = tomlkit.aot()
        for number, entry in enumerate(value):
            tables.append(_table(entry, rig, f"{dotted}.{number}"))
        holder[name] = tables
    elif dotted in rig.assumed or dotted in rig.sources:
        table = tomlkit.inline_table()
        table["value"] = value
        if dotted in rig.assumed:
            unit = unit_of(Rig, dotted.split("."), rig) or ""
            table["assumed"] = [format_quantity(end, unit) for end in rig.assumed[dotted]]
        if dotted in rig.sources:
            table["source"] = rig.sources[dotted]
        holder[name] = table
    elif not (isinstance(value, list) and not value):
        holder[name] = value


def _table(values: dict[str, Any], rig: Rig, dotted: str) -> Table:
    table = tomlkit.table()
    # Inner tables come last: in TOML all keys after them would belong to them.
    for name in sorted(values, key=lambda n: isinstance(values[n], dict)):
        _add(table, name, values[name], rig, f"{dotted}.{name}")
    return table


def commented_rig(
    part: str = "", name: str = "paper", base: str = "", folder: Path | None = None
) -> str:
    """Return the text of a rig file to start from, with a comment above every key.

    Values and their sources are those of the base, and where it lacks one that a rig needs those
    of the packaged rig `paper`; keys that it does not set are comments with their defaults, and so
    are optional tables.

    Args:
        part: One of `PARTS`, for its tables alone; empty for all tables.
        name: Name of the rig.
        base: The rig that has the other tables; its optional ones and those values that are
            defaults are comments.
        folder: Folder of the new file, from which the base is seen; None: the working directory.

    Raises:
        RigError: The base cannot be read.
    """
    document: dict[str, Any] = tomlkit.parse(
        named_text("paper", "sautereau.rig", "rig", RigError)[0]
    )
    for key in ("run_up_acceleration", "run_up_jerk"):  # chosen by the clearance of another jack
        del document["press"][key]
    origin, of_base = "the packaged rig paper", f"base = {json.dumps(base)}"
    if base:
        layers = Layers(of_base, name, folder or Path())
        required = {(t.name, e.name) for t in describe() for e in t.entries if e.default is None}
        for table in PARTS[part]:
            if isinstance(layers.base.get(table), dict):
                others = {k: v for k, v in document[table].items() if (table, k) in required}
                document[table] = others | _origins(layers, table)
        origin = f"the base, and where it lacks one those of {origin}"
    whose = f"the {part} of a rig" if part else "all quantities of a bench"
    lines = [
        *_comment(
            f"A rig file: {whose}. Lengths on the key are measured from the"
            " balance pin. A value is a quantity in any unit of its dimension, or a table with the"
            " value and its origin: its source, or its assumed range. The values are those of"
            f" {origin}; replace them by your own."
        ),
        "",
    ]
    if base:
        about = "What this file does not set is that of its base: a packaged rig or other rig files"
        lines += [*_comment(about), of_base]
        document["name"] = name
    for table in describe():
        head = table.name.partition(".")[0]
        if head in PARTS[part] if part else head != _ALIKE:
            lines += _commented(table, document, inherits=bool(base))
        elif base and not head:
            lines += _commented(table, document)
    if part == "bench":
        return "\n".join(lines).replace("\n\n\n", "\n\n") + "\n"
    lines += [
        "",
        *_comment(
            f"More strings that the key plucks: [[{_ALIKE}]] with jack_arm and its own tables"
            " jack, plectrum and string as above."
        ),
    ]
    return "\n".join(lines) + "\n"


def _origins(layers: Layers, table: str) -> dict[str, Any]:
    """Return a table of the bases with the ranges and sources of its values."""
    found: dict[str, Any] = {}
    for key, value in layers.base[table].items():
        at, about = f"{table}.{key}", tomlkit.inline_table()
        about["value"] = value
        about |= {"assumed": layers.assumed[at][1]} if at in layers.assumed else {}
        about |= {"source": layers.sources[at]} if at in layers.sources else {}
        found[key] = about if len(about) > 1 else value
    return found


def _commented(table: TableDescription, document: Any, *, inherits: bool = False) -> Iterator[str]:
    found = None if inherits and not table.needed else _at(document, table.name)
    header = f"[[{table.name}]]" if table.repeated else f"[{table.name}]"
    for values in found if isinstance(found, list) else [found]:
        absent = "# " if values is None else ""
        if table.name:
            yield ""
            of_base = " Without it, that of the base." if inherits else ""
            yield from _comment(table.meaning + (f" Optional.{of_base}" if absent else ""))
            yield absent + header
        for entry in table.entries:
            yield from _comment(_about(entry))
            is_default = inherits and values is not None and _is_default(entry, values)
            yield _line(entry, {} if is_default else values, absent)


def _at(document: Any, dotted: str) -> Any:
    """Return the table of that name in the document, or None."""
    node = document
    for key in dotted.split(".") if dotted else ():
        node = node.get(key) if isinstance(node, dict) else None
    return node


def _about(entry: KeyDescription) -> str:
    quantity = entry.kind.endswith("quantity")
    parts = [
        entry.meaning.rstrip("."),
        "" if quantity else entry.kind,
        f"{entry.limits} {entry.unit}".strip() if entry.limits else f"in {entry.unit}",
    ]
    return "; ".join(part for part in parts if part and part != "in ")


def _line(entry: KeyDescription, values: Any, absent: str) -> str:
    if values is not None and entry.name in values:
        return f"{entry.name} = {tomlkit.item(values[entry.name]).as_string()}"
    return f"# {entry.name} = {entry.default or '...'}" if not absent else f"# {entry.name} = ..."


def _is_default(entry: KeyDescription, values: Any) -> bool:
    """Return whether the value of a key is its default."""
    value = values.get(entry.name)
    return entry.default == json.dumps(value.get("value") if isinstance(value, dict) else value)


def _comment(text: str) -> list[str]:
    return textwrap.wrap(text, 88, initial_indent="# ", subsequent_indent="# ")
