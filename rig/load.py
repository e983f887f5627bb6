"""Read a rig file, and report all its faults at once; give a rig other values."""

import logging
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from sautereau.rig.csv_files import read_gesture
from sautereau.rig.disk import named_text
from sautereau.rig.document import RENAMED_KEYS, current_key, rename_keys, rig_document, validated
from sautereau.rig.errors import RigError
from sautereau.rig.faults import (
    at_line,
    line_of,
    model_keys,
    near_miss,
    unit_of,
)
from sautereau.rig.schema import Rig
from sautereau.rig.units import parse_quantity, shown

_LOG = logging.getLogger(__name__)
MODULI = (0.1e9, 300e9)  # Pa, from soft quill to steel: others are asked to be confirmed
DEEPEST = 20
"""Limit of the depth of tables and arrays in a file; those of a rig or a scene are 6 deep."""
_TOO_DEEP = f"its tables or arrays are nested more than {DEEPEST} deep; shorten it"


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

    A key that was renamed is accepted under its old name, with a note on standard error.

    Args:
        folder: Folder of the files that it names; None for the working directory.
        others: Tables for those that the text lacks, as read from TOML.

    Raises:
        RigError: Lists every fault.
    """
    document = {**others, **read_toml(text, origin, RigError)}
    for old in rename_keys(document):
        name = RENAMED_KEYS[old].rpartition(".")[2]
        _LOG.warning("%s: %s", origin, at_line(line_of(text, old), f"rename {old} to {name}"))
    origins = Origins()
    values = origins.split(document)
    found = [*origins.faults, *read_files(values, folder or Path())]
    ranges, range_faults = assumed_ranges(origins.assumed, values)
    faults = [at_line(line_of(text, key), f"{key}: {fault}") for key, fault in found + range_faults]
    rig = validated(values, origin, faults, text)
    for key, modulus in _unusual_moduli(rig):
        if key not in origins.assumed and key not in origins.sources:
            _LOG.warning(
                "%s: %s",
                origin,
                at_line(
                    line_of(text, key),
                    f"{key}: {modulus / 1e9:.4g} GPa is not within {MODULI[0] / 1e9:g} to"
                    f" {MODULI[1] / 1e9:g} GPa, as those of plectra; correct its unit, or confirm"
                    " it with a source or an assumed range",
                ),
            )
    return rig.model_copy(update={"assumed": ranges, "sources": origins.sources})


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
        *parents, last = current_key(dotted).split(".")
        node: Any = document
        try:
            for part in parents:
                node = node[int(part)] if isinstance(node, list) else node[part]
            if not isinstance(node, dict) or last not in node or isinstance(node[last], dict):
                raise KeyError(last)
        except (KeyError, IndexError, ValueError, TypeError):
            faults.append(f"{dotted}: unknown quantity{near_miss(dotted, list(model_keys(Rig)))}")
            continue
        node[last] = value
    changed = validated(document, f"rig {rig.name}", faults)
    kept = {"assumed": rig.assumed, "sources": rig.sources, "daq_only": rig.daq_only}
    return changed.model_copy(update=kept)


def read_toml(text: str, origin: str, error_type: type[Exception]) -> dict[str, Any]:
    """Parse TOML; ``error_type`` is raised with the line of the fault.

    Tables are nested at most `DEEPEST` deep, so that whoever uses them may recurse.
    """
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise error_type(f"{origin}: not valid TOML: {error}; correct that line") from error
    except ValueError as error:
        most = sys.get_int_max_str_digits()
        raise error_type(f"{origin}: a number has over {most} digits; shorten it") from error
    except RecursionError as error:
        raise error_type(f"{origin}: {_TOO_DEEP}") from error
    level: list[Any] = [document]
    for _ in range(DEEPEST):
        level = [inner for node in level for inner in _inside(node)]
    if level:
        raise error_type(f"{origin}: {_TOO_DEEP}")
    return document


def _inside(node: Any) -> Iterable[Any]:
    """Return what is directly inside a table or an array."""
    return node.values() if isinstance(node, dict) else node if isinstance(node, list) else ()


def read_files(values: dict[str, Any], folder: Path) -> list[tuple[str, str]]:
    """Replace the names of files by their contents; return the faults in them."""
    faults: list[tuple[str, str]] = []
    press = values.get("press")
    gesture = press.get("gesture") if isinstance(press, dict) else None
    if isinstance(press, dict) and isinstance(gesture, dict) and set(gesture) == {"file"}:
        try:
            press["gesture"] = read_gesture(folder / str(gesture["file"]))
        except RigError as error:
            del press["gesture"]
            faults.append(("press.gesture", str(error)))
    choirs = values.get("more_choirs")
    holders = [("", values)]
    if isinstance(choirs, list):
        holders += [(f"more_choirs.{i}.", c) for i, c in enumerate(choirs) if isinstance(c, dict)]
    for prefix, holder in holders:
        plectrum = holder.get("plectrum")
        outline = plectrum.get("outline") if isinstance(plectrum, dict) else None
        if isinstance(plectrum, dict) and isinstance(outline, dict) and "file" in outline:
            from sautereau.rig.outline import read_outline  # imports numpy; few rigs need it

            try:
                read = plectrum["outline"] = read_outline(outline, folder)
                depth = parse_quantity(read["top"][0], "m") - parse_quantity(read["bottom"][0], "m")
                plectrum.setdefault("length", read["x"][-1])
                plectrum.setdefault("thickness", f"{depth!r} m")
            except RigError as error:
                del plectrum["outline"]
                faults.append((f"{prefix}plectrum.outline", str(error)))
    return faults


def _unusual_moduli(rig: Rig) -> Iterator[tuple[str, float]]:
    """Yield keys and values [Pa] of Young's moduli that no plectrum has."""
    plectra = {"plectrum": rig.plectrum}
    plectra |= {f"more_choirs.{n}.plectrum": c.plectrum for n, c in enumerate(rig.more_choirs)}
    for key, plectrum in plectra.items():
        if not MODULI[0] <= plectrum.youngs_modulus <= MODULI[1]:
            yield f"{key}.youngs_modulus", plectrum.youngs_modulus


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
