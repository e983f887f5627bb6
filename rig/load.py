"""Read a rig file, and report all its faults at once; give a rig other values."""

import logging
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Any

from sautereau.rig.disk import named_text, table_beside
from sautereau.rig.document import current_key, rig_document, validated
from sautereau.rig.errors import RigError
from sautereau.rig.faults import (
    Condition,
    bare_key,
    model_keys,
    near_miss,
    unit_of,
    without_effect,
)
from sautereau.rig.layers import Layers, read_toml
from sautereau.rig.schema import Rig
from sautereau.rig.units import Section, parse_quantity, readable_quantity, shown

_LOG = logging.getLogger(__name__)
USUAL = {
    key: (unit, float(least), float(most))
    for key, unit, least, most, _ in table_beside(Path(__file__).with_name("usual"))
}
"""Unit and range of values that plucked instruments have: others are asked to be confirmed."""
ACTS_IF = {
    "arm.gear_ratios": (
        Condition("arm.rotor_inertias"),
        Condition("controller.home_index", (True,)),
        Condition("controller.kind", but=("galil",)),  # counts the motors' revolutions
    ),
}
"""Values with which others act."""
PARTS = "key", "jack", "plectrum", "string"


def load_rig(name: str | Path = "paper") -> Rig:
    """Load a rig from a TOML file, or a packaged one by its name.

    Raises:
        RigError: Lists every fault of the file with its line, value, what is allowed.
    """
    return parse_rig(*named_text(name, "sautereau.rig", "rig", RigError))


def load_rig_to_acquire(name: str | Path) -> Rig:
    """Load a rig to record without a press: its file may have `[daq]` alone, and a `name`.

    The other values are then those of the packaged rig, and `Rig.daq_only` says so.

    Raises:
        RigError: Lists every fault of the file.
    """
    text, origin, folder = named_text(name, "sautereau.rig", "rig", RigError)
    tables = set(read_toml(text, origin, RigError))
    if "daq" not in tables or not tables <= {"name", "daq"}:
        return parse_rig(text, origin, folder)
    packaged, *_ = named_text("paper", "sautereau.rig", "rig", RigError)
    others = read_toml(packaged, "paper", RigError) | {"name": Path(name).stem}
    return parse_rig(text, origin, folder, others).model_copy(update={"daq_only": True})


def parse_rig(
    text: str,
    origin: str = "rig",
    folder: Path | None = None,
    others: Mapping[str, Any] = MappingProxyType({}),
) -> Rig:
    """Build a rig from the text of a TOML file.

    A key that was renamed is accepted under its old name, with a note on standard error. What the
    text does not set is that of its `base`, if it names one; see `sautereau.rig.layers.Layers`.

    Args:
        folder: Folder of the files that it names; None for the working directory.
        others: Tables for those that the text lacks, as read from TOML.

    Raises:
        RigError: Lists every fault.
    """
    return rig_of(Layers(text, origin, folder or Path(), others))


def rig_of(layers: Layers) -> Rig:
    """Build a rig from the layers of its file.

    Raises:
        RigError: Lists every fault.
    """
    origin = layers.own.origin
    ranges, range_faults = assumed_ranges(layers.assumed, layers.values)
    found = layers.faults + [(layers.place(key), f"{key}: {why}") for key, why in range_faults]
    try:
        faults = [place.said(fault) for place, fault in found]
        rig = validated(layers.values, origin, faults, layers.place)
    except RigError as error:
        for key in layers.replaced:
            error.add_note(
                f"[[{key}]] replaces that of the base; [{key}.0] changes its first entry"
            )
        raise
    for key, why in _unusual(rig):
        if key not in layers.assumed:
            _LOG.warning("%s: %s", origin, layers.place(key).said(f"{key}: {why}"))
    return rig.model_copy(update={"assumed": ranges, "sources": layers.sources})


def with_values(rig: Rig, values: Mapping[str, Any]) -> Rig:
    """Return the rig with some values replaced and validated.

    Args:
        values: TOML values by dotted key: ``{"press.jack_speed": "0.1 m/s"}``; a list
            entry is named by its index: ``"daq.channels.0.delay"``.

    Raises:
        RigError: A key does not exist, or the new rig is not valid.
    """
    document = rig_document(rig)
    faults = []
    for dotted, value in values.items():
        *parents, last = (key := current_key(dotted)).split(".")
        node: Any = document
        try:
            for part in parents:
                if isinstance(node, dict) and node[part] is None and _is_key(key):
                    node[part] = {}  # an optional table, such as that of an outline
                node = node[int(part)] if isinstance(node, list) else node[part]
            if not isinstance(node, dict) or isinstance(node.get(last), dict):
                raise KeyError(last)
            if last not in node and not _is_key(key):
                raise KeyError(last)
        except (KeyError, IndexError, ValueError, TypeError):
            of_list = isinstance(node, list)
            hint = f"; the rig has {len(node)} of these, with indices from 0" if of_list else None
            near = near_miss(dotted, list(model_keys(Rig)))
            faults.append(f"{dotted}: unknown quantity{hint or near}")
            continue
        node[last] = value
    changed = validated(document, f"rig {rig.name}", faults)
    kept = {"assumed": rig.assumed, "sources": rig.sources, "daq_only": rig.daq_only}
    return changed.model_copy(update=kept)


def _is_key(key: str) -> bool:
    """Return whether a rig may have a dotted key, of which entries of lists are named by index."""
    return bare_key(key) in model_keys(Rig)


def _unusual(rig: Rig) -> Iterator[tuple[str, str]]:
    """Yield keys of values without effect, or that no instrument has, and what to do."""
    for key in ACTS_IF:
        table, _, name = key.partition(".")
        section = getattr(rig, table)
        if (value := getattr(section, name)) != type(section).model_fields[name].default:
            yield from without_effect({key: value}, ACTS_IF, rig)
    tables: list[tuple[str, str, Section]] = [(part, part, getattr(rig, part)) for part in PARTS]
    for n, choir in enumerate(rig.more_choirs):
        of = f"more_choirs.{n}"
        tables += [(of, "key", choir)]
        tables += [(f"{of}.{part}", part, getattr(choir, part)) for part in PARTS[1:]]
    for (table, part, section), (key, (unit, low, high)) in product(tables, USUAL.items()):
        of, name = key.split(".")
        value = getattr(section, name, None)
        if of == part and value is not None and not low <= value <= high:
            found, least, most = (readable_quantity(each, unit) for each in (value, low, high))
            yield (
                f"{table}.{name}",
                f"{found} is not within {least} to {most}, as on plucked instruments; correct its"
                " unit, or confirm it by its `assumed` range",
            )


def assumed_ranges(assumed: dict[str, tuple[Any, Any]], values: dict[str, Any]):
    """Return the assumed ranges [SI] by dotted key, and the faults in them."""
    known = set(model_keys(Rig))
    ranges: dict[str, tuple[float, float]] = {}
    faults: list[tuple[str, str]] = []
    for key, (value, pair) in assumed.items():
        if bare_key(key) not in known:
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
