"""A rig as the text of a rig file, with the origins of its values."""

from typing import TYPE_CHECKING, Any

from sautereau.rig.faults import unit_of
from sautereau.rig.load import rig_document
from sautereau.rig.schema import Rig
from sautereau.rig.units import format_quantity

if TYPE_CHECKING:
    from tomlkit.items import InlineTable, Table


def rig_text(rig: Rig) -> str:
    """Return a rig as TOML that `rig.load.parse_rig` reads back: values, ranges and sources.

    It has none of the comments of the original file, and includes the content of files that the
    original named.
    """
    import tomlkit

    document = tomlkit.document()
    plain: dict[str, Any] = {}
    for name, value in rig_document(rig).items():
        _add(document if not isinstance(value, dict) else plain, name, value, rig, name)
    document.update(plain)
    return tomlkit.dumps(document)


def _add(holder: Any, name: str, value: Any, rig: Rig, dotted: str) -> None:
    """Put a value into a table of the document; None is omitted."""
    import tomlkit

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


def _table(values: dict[str, Any], rig: Rig, dotted: str) -> "Table":
    import tomlkit

    table = tomlkit.table()
    # Inner tables come last: in TOML all keys after them would belong to them.
    for name in sorted(values, key=lambda n: isinstance(values[n], dict)):
        _add(table, name, values[name], rig, f"{dotted}.{name}")
    return table


def _with_origin(value: Any, rig: Rig, dotted: str) -> "InlineTable":
    import tomlkit

    table = tomlkit.inline_table()
    table["value"] = value
    if dotted in rig.assumed:
        unit = unit_of(Rig, dotted.split("."), rig) or ""
        table["assumed"] = [format_quantity(end, unit) for end in rig.assumed[dotted]]
    if dotted in rig.sources:
        table["source"] = rig.sources[dotted]
    return table
