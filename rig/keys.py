"""The keys of an instrument as one table: each is a rig, by its differences from one base."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sautereau.rig.csv_files import read_rows
from sautereau.rig.document import full_key, typed_value
from sautereau.rig.errors import RigError
from sautereau.rig.faults import bare_key, fault_list, line_of, model_keys, near_miss
from sautereau.rig.layers import read_toml_file
from sautereau.rig.load import parse_rig
from sautereau.rig.schema import Rig
from sautereau.rig.units import shown

MOST_KEYS = 1000  # Limit of a table's keys
EXAMPLE = "key,string.length [mm],plectrum.overlap [mm],plectrum.outline,recordings"
_LISTED = 5  # Keys whose faults are listed


@dataclass(frozen=True)
class InstrumentKey:
    """One key of an instrument."""

    name: str
    """As the table names it: its note, or its number."""
    rig: Rig
    recordings: tuple[str, ...] = ()
    """Recordings of its presses: files, folders of sessions, or patterns."""


def read_keys(path: Path, base: str | None = None) -> tuple[InstrumentKey, ...]:
    """Read the keys of a table, in its order.

    A CSV file has a column `key` with their names; others are values of the rig by their dotted
    keys or short names, with their units in brackets or in the cells, and `recordings`. An empty
    cell is the value of the base. A TOML file has a table for each key, `[keys.a4]`, with what a
    rig file may have, and `recordings`; and it may name its `base`.

    Args:
        path: The file; files that it names are seen from its folder.
        base: Rig of all other values, a packaged one or the path of a file, if the table has none.

    Raises:
        RigError: Lists the faults of the table, or those of its first keys that have any.
    """
    origin, folder = f"table of keys {path}", path.parent
    if path.suffix == ".toml":
        own, keys = _of_toml(path, origin)
        if own and base:
            raise RigError(f"{origin}: it has the base {shown(own)}; omit {base}, or remove `base`")
    else:
        own, keys = None, _of_csv(path, origin)
    if base and Path(base).is_file():
        base = str(Path(base).resolve())
    text = f"base = {json.dumps(own or base or 'paper')}\n"
    found: list[InstrumentKey] = []
    faults: list[str] = []
    for name, place, values in keys:
        given = values.pop("recordings", [])
        named = [given] if isinstance(given, str) else given
        where = f"{origin}, {place}"
        if not isinstance(named, list) or not all(isinstance(one, str) for one in named):
            faults.append(
                f"{where}: recordings: {shown(given)} is refused; give a path, or several"
            )
            continue
        if taken := sorted({"name", "base"} & set(values)):
            faults.append(f"{where}: {', '.join(taken)}: that of a key is given by its table")
            continue
        try:
            rig = parse_rig(f"{text}name = {json.dumps(name)}\n", where, folder, values)
        except RigError as error:
            faults.append("\n".join([str(error), *getattr(error, "__notes__", ())]))
            continue
        found.append(InstrumentKey(name, rig, tuple(str(folder / one) for one in named)))
    if faults:
        more = [f"and {len(faults) - _LISTED} more keys"] if len(faults) > _LISTED else []
        raise RigError("\n".join([*faults[:_LISTED], *more]))
    return tuple(found)


def _of_toml(path: Path, origin: str) -> tuple[Any, list[tuple[str, str, dict[str, Any]]]]:
    """Return the base, and name, place and differences of each key."""
    text, document = read_toml_file(path, origin, RigError)
    base, keys = document.pop("base", None), document.pop("keys", None)
    faults = [f"{name}: unknown key; write it into the tables of keys" for name in document]
    if not (keys and isinstance(keys, dict) and all(isinstance(k, dict) for k in keys.values())):
        faults.append("it has no table of a key; add [keys.NAME] for each")
    elif len(keys) > MOST_KEYS:
        faults.append(f"{len(keys)} keys, more than the limit {MOST_KEYS}; divide it")
    if faults or not isinstance(keys, dict):
        raise RigError(fault_list(origin, faults))
    return base, [
        (name, f"line {line_of(text, f'keys.{name}')}: {name}", dict(own))
        for name, own in keys.items()
    ]


def _of_csv(path: Path, origin: str) -> list[tuple[str, str, dict[str, Any]]]:
    """Return name, place and differences of each key."""
    rows, decimal = read_rows(path, origin, RigError, MOST_KEYS + 1, "divide it")
    heads = [
        cell.strip().removesuffix("]").partition("[")
        for cell in (rows[0] if rows and rows[0] else [""])
    ]
    names, faults = zip(*(_column(head.strip()) for head, *_ in heads), strict=True)
    faults = [f"line 1: {fault}" for fault in faults if fault]
    faults += [f"line 1: column {name} occurs twice" for name in {*names} if names.count(name) > 1]
    if "key" not in names:
        faults.append(f'line 1: no column `key`; start the file like "{EXAMPLE}"')
    keys: dict[str, tuple[str, dict[str, Any]]] = {}
    for line, cells in enumerate(rows[1:], 2):
        texts = [cell.strip() for cell in cells]
        units = (unit.strip() for *_, unit in heads)
        given = {n: (t, u) for n, t, u in zip(names, texts, units, strict=False) if t}
        name, _ = given.pop("key", ("", ""))
        if any(texts) and (not name or name in keys or len(texts) > len(names)):
            faults.append(
                f"line {line}: key {shown(name)}, {len(texts)} cells under {len(names)} columns;"
                " give each key its own name, and quote a cell that contains the separator"
            )
        elif name:
            keys[name] = f"line {line}: {name}", _nested(given, decimal)
    if not keys and not faults:
        faults.append("it has no key; add a row for each")
    if faults:
        raise RigError(fault_list(origin, faults))
    return [(name, *own) for name, own in keys.items()]


def _column(name: str) -> tuple[str, str]:
    """Return the dotted key of a column, and what is wrong with it."""
    if name in ("key", "recordings"):
        return name, ""
    try:
        key = full_key(name)
    except RigError as error:
        return name, str(error)
    known = sorted(set(model_keys(Rig)))
    unknown = f"{name}: no such quantity{near_miss(name, known)}"
    return key, "" if bare_key(key) in known else unknown


def _nested(cells: Mapping[str, tuple[str, str]], decimal: str) -> dict[str, Any]:
    """Return the cells of a key, text and unit, as the tables of a rig file."""
    values: dict[str, Any] = {}
    for key, (text, unit) in cells.items():
        *parents, last = key.split(".")
        table = values
        for part in parents:
            table = table.setdefault(part, {})
        table[last] = _value(key, text, unit, decimal)
    return values


def _value(key: str, text: str, unit: str, decimal: str) -> Any:
    if key == "recordings":
        return text
    if key.endswith("plectrum.outline"):
        return {"file": text}
    return typed_value(key, f"{text.replace(decimal, '.')} {unit}".strip())
