"""A rig as the text of a rig file: with its values' origins, or commented, to start from."""

import textwrap
from collections.abc import Iterator
from typing import Any

import tomlkit
from tomlkit.items import InlineTable, Table

from sautereau.rig.describe import KeyDescription, TableDescription, describe
from sautereau.rig.errors import RigError
from sautereau.rig.faults import unit_of
from sautereau.rig.load import rig_document
from sautereau.rig.packaged import named_text
from sautereau.rig.schema import Rig
from sautereau.rig.units import format_quantity

_WIDTH = 88
_ALIKE = "more_choirs"  # Table with the same inner tables as the first choir


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
        holder[name] = _with_origin(value, rig, dotted)
    elif not (isinstance(value, list) and not value):
        holder[name] = value


def _table(values: dict[str, Any], rig: Rig, dotted: str) -> Table:
    table = tomlkit.table()
    # Inner tables come last: in TOML all keys after them would belong to them.
    for name in sorted(values, key=lambda n: isinstance(values[n], dict)):
        _add(table, name, values[name], rig, f"{dotted}.{name}")
    return table


def _with_origin(value: Any, rig: Rig, dotted: str) -> InlineTable:
    table = tomlkit.inline_table()
    table["value"] = value
    if dotted in rig.assumed:
        unit = unit_of(Rig, dotted.split("."), rig) or ""
        table["assumed"] = [format_quantity(end, unit) for end in rig.assumed[dotted]]
    if dotted in rig.sources:
        table["source"] = rig.sources[dotted]
    return table


def commented_rig() -> str:
    """Return the text of a rig file to start from, with a comment above every key.

    Values and their sources are those of the packaged rig `paper`; keys that it does not set are
    comments with their defaults, and so are optional tables.
    """
    document = tomlkit.parse(named_text("paper", "sautereau.rig", "rig", RigError)[0])
    lines = [
        *_comment(
            "A rig file: all quantities of a bench. Lengths on the key are measured from the"
            " balance pin. A value is a quantity in any unit of its dimension, or a table with the"
            " value and its origin: its source, or its assumed range. The values are those of the"
            " packaged rig paper; replace them by your own."
        ),
        "",
    ]
    for table in describe():
        if table.name.partition(".")[0] != _ALIKE:
            lines += _commented(table, document)
    lines += [
        "",
        *_comment(
            f"More strings that the key plucks: [[{_ALIKE}]] with jack_arm and its own tables"
            " jack, plectrum and string as above."
        ),
    ]
    return "\n".join(lines) + "\n"


def _commented(table: TableDescription, document: Any) -> Iterator[str]:
    found = _at(document, table.name)
    header = f"[[{table.name}]]" if table.repeated else f"[{table.name}]"
    for values in found if isinstance(found, list) else [found]:
        absent = "# " if values is None else ""
        if table.name:
            yield ""
            yield from _comment(table.meaning + (" Optional." if absent else ""))
            yield absent + header
        for entry in table.entries:
            yield from _comment(_about(entry))
            yield _line(entry, values, absent)


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
        return f"{entry.name} = {values[entry.name].as_string()}"
    return f"# {entry.name} = {entry.default or '...'}" if not absent else f"# {entry.name} = ..."


def _comment(text: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent="# ", subsequent_indent="# ")
