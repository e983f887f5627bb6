"""The layers of a rig file: the rigs that its `base` names, and its own differences over them."""

import logging
import re
import sys
import tomllib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from sautereau.rig.csv_files import read_gesture
from sautereau.rig.disk import explained, named_text, read_text
from sautereau.rig.document import RENAMED_KEYS, flat, rename_keys
from sautereau.rig.errors import RigError
from sautereau.rig.faults import Place, fault_list, line_of, near_miss
from sautereau.rig.units import parse_quantity, shown

_LOG = logging.getLogger(__name__)
_INDEX = re.compile("[0-9]{1,6}")  # Of an entry of a list
DEEPEST = 20
"""Limit of the depth of tables and arrays in a file; those of a rig or a scene are 6 deep."""
_TOO_DEEP = f"its tables or arrays are nested more than {DEEPEST} deep; shorten it"


@dataclass(frozen=True)
class Layer:
    """One file of a rig."""

    origin: str
    """Its name in messages."""
    text: str
    values: dict[str, Any]
    """What it sets, as TOML holds it, with the contents of the files that it names."""
    origins: "Origins"
    """Ranges and sources of these values, and all faults found so far."""

    def sets(self, key: str) -> bool:
        """Return whether it gives a dotted key its value, or a value to what the key is inside."""
        node: Any = self.values
        for part in key.split("."):
            if not isinstance(node, dict):
                return True
            if part not in node:
                return False
            node = node[part]
        return True


class Layers:
    """The files of a rig; each overrides those before it, the last one is the rig's own.

    A table is merged with that of the base; a value, with its range and source, and a list replace
    those of the base. A table of numbers, `[more_choirs.0.plectrum]`, changes entries of a list;
    `false` removes an optional table or value.

    Args:
        text: The rig file.
        origin: Its name in messages.
        folder: Folder of the files that it names.
        others: Tables for those that the text lacks, as read from TOML.

    Raises:
        RigError: A text is not valid TOML, or a base cannot be read or has itself as base.
    """

    def __init__(
        self, text: str, origin: str, folder: Path, others: Mapping[str, Any] = MappingProxyType({})
    ):
        self._inside: list[str] = []
        self._layers: dict[str, Layer] = {}
        self._read(text, origin, folder, others, str(Path(origin).resolve()))
        *self.bases, self.own = self._layers.values()
        self.faults: list[tuple[Place, str]] = []
        """Faults found so far, each with its place and after its key."""
        self.base: dict[str, Any] = {}
        """Values of all bases together, without their names."""
        self.replaced: list[str] = []
        """Keys of lists of tables that replace those of a base."""
        for layer in self.bases:
            self.base = self._merged(self.base, layer.values, "", layer)
        self.base.pop("name", None)
        self.values: dict[str, Any] = self._merged(self.base, self.own.values, "", self.own)
        """Values of the rig, as TOML holds them."""
        self.assumed: dict[str, tuple[Any, Any]] = {}
        self.sources: dict[str, str] = {}
        for layer in self._layers.values():
            origins = layer.origins
            self.assumed = _kept(self.assumed, layer) | origins.assumed
            self.sources = _kept(self.sources, layer) | origins.sources
            self.faults += [(self._at(layer, k), f"{k}: {why}") for k, why in origins.faults]

    @property
    def differences(self) -> dict[str, tuple[Any, Any]]:
        """Value of the base and own value, as TOML holds them, by dotted key; None for no value."""
        base, values = flat(self.base), flat(self.values)
        return {
            key: (base.get(key), values.get(key))
            for key in {**values, **base}
            if base.get(key) != values.get(key)
        }

    def place(self, key: str) -> Place:
        """Return the place of a dotted key's value; without one, of the own table that lacks it."""
        # The name of a rig is its own.
        layers = [layer for layer in self._layers.values() if key != "name" and layer.sets(key)]
        return self._at(layers[-1] if layers else self.own, key)

    def _at(self, layer: Layer, key: str) -> Place:
        order = list(self._layers.values())[::-1].index(layer)
        origin = "" if layer is self.own else layer.origin
        return Place(order, line_of(layer.text, key) or 0, origin)

    def _read(
        self, text: str, origin: str, folder: Path, others: Mapping[str, Any], identity: str
    ) -> None:
        """Read a file after its bases; one that is inherited twice counts where it comes first."""
        document = {**others, **read_toml(text, origin, RigError)}
        refuse_other(document, "a rig", origin, RigError)
        bases = document.pop("base", [])
        faults = []
        self._inside.append(identity)
        for name in bases if isinstance(bases, list) else [bases]:
            try:
                self._read_base(name, folder)
            except RigError as error:
                faults.append(Place(0, line_of(text, "base") or 0).said(f"base: {error}"))
        self._inside.pop()
        if faults:
            raise RigError(fault_list(origin, faults))
        for old in rename_keys(document):
            name = RENAMED_KEYS[old].rpartition(".")[2]
            place = Place(0, line_of(text, old) or 0)
            _LOG.warning("%s: %s", origin, place.said(f"rename {old} to {name}"))
        origins = Origins()
        values = origins.split(document)
        origins.faults.extend(_read_files(values, folder))
        self._layers[identity] = Layer(origin, text, values, origins)

    def _read_base(self, name: Any, folder: Path) -> None:
        if not isinstance(name, str) or not name:
            raise RigError(
                f"{shown(name)} is refused; give the name of a packaged rig, the path of a rig"
                " file, or a list of them"
            )
        beside = folder / name
        is_file = beside.suffix == ".toml" or beside.is_file()
        text, origin, inside = named_text(
            beside if is_file else name, "sautereau.rig", "rig", RigError
        )
        identity = str(beside.resolve()) if is_file else origin
        if identity in self._inside:
            raise RigError(f"{origin} has itself as base; remove one of these lines")
        if len(self._inside) > DEEPEST:
            raise RigError(f"{origin}: it is the base of a base more than {DEEPEST} times")
        if identity not in self._layers:
            self._read(text, origin, inside, {}, identity)

    def _merged(self, base: Any, own: Any, at: str, layer: Layer) -> Any:
        """Return a value of the bases with the differences of a layer."""
        dot = f"{at}." if at else ""
        indexed = isinstance(own, dict) and own and all(map(_INDEX.fullmatch, own))
        if base and isinstance(base, list) and indexed:
            result = list(base)
            for index, value in own.items():
                if int(index) < len(base):
                    entry = self._merged(base[int(index)], value, f"{dot}{index}", layer)
                    result[int(index)] = entry
                else:
                    fault = (
                        f"the base has {len(base)} entries, 0 to {len(base) - 1}; write all as"
                        f" [[{at}]] to have more"
                    )
                    layer.origins.faults.append((f"{dot}{index}", fault))
            return result
        if not (isinstance(base, dict) and isinstance(own, dict)):
            if _entries(base) and _entries(own):
                self.replaced.append(at)
            return own
        result = dict(base)
        for name, value in own.items():
            if value is False and name in base and not isinstance(base[name], bool):
                del result[name]
            elif name in base:
                result[name] = self._merged(base[name], value, f"{dot}{name}", layer)
            else:
                result[name] = value
        return result


def _kept(origins: dict[str, Any], layer: Layer) -> dict[str, Any]:
    """Return the origins of values that a layer does not replace."""
    return {key: about for key, about in origins.items() if not layer.sets(key)}


def _entries(value: Any) -> bool:
    """Return whether a value is a list of tables."""
    return isinstance(value, list) and bool(value) and isinstance(value[0], dict)


def read_toml_file(
    path: Path,
    origin: str,
    error_type: type[Exception],
    fix: str = "give the path of a TOML file",
) -> tuple[str, dict[str, Any]]:
    """Return the text of a file and its values; ``error_type`` is raised as by `read_toml`."""
    with explained(error_type, f"{origin}: cannot be read", fix):
        text = read_text(path)
    return text, read_toml(text, origin, error_type)


_MARKS = {
    "a rig": ("key", "jack", "press", "arm", "daq"),
    "a scene": ("finger", "friction", "felt"),
}


def refuse_other(
    document: Mapping[str, Any], what: str, origin: str, error_type: type[Exception]
) -> None:
    """Refuse a scene in place of a rig, and the reverse, which would have a fault in each line."""
    marks = {kind: len({*names} & {*document}) for kind, names in _MARKS.items()}
    kind = max(marks, key=lambda kind: marks[kind])
    if kind != what and marks[kind] > 1 and not marks[what]:
        raise error_type(f"{origin}: it is {kind}, not {what}; give the file of {what}")


def read_toml(text: str, origin: str, error_type: type[Exception]) -> dict[str, Any]:
    """Parse TOML; ``error_type`` is raised with the line of the fault.

    Tables are nested at most `DEEPEST` deep, so that whoever uses them may recurse.
    """
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        # "Cannot declare twice" and the like: the table of a dotted key has its first part as name.
        again = ", or rename one of the two, such as a group of a design" * ("Cannot" in str(error))
        raise error_type(f"{origin}: not valid TOML: {error}; correct that line{again}") from error
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


_SIZES = ("x", -1), ("top", 0), ("bottom", 0)  # Points of an outline with its length and thickness


def _read_files(values: dict[str, Any], folder: Path) -> list[tuple[str, str]]:
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
        if not (isinstance(plectrum, dict) and isinstance(outline, dict)):
            continue
        if "file" in outline:
            from sautereau.rig.outline import read_outline  # imports numpy; few rigs need it

            try:
                outline = plectrum["outline"] = read_outline(outline, folder)
            except RigError as error:
                del plectrum["outline"]
                faults.append((f"{prefix}plectrum.outline", str(error)))
                continue
        # Its sizes go before those of a base; what is no outline is refused with all values.
        with suppress(KeyError, IndexError, TypeError, ValueError):
            end, top, bottom = (parse_quantity(outline[n][i], "m") for n, i in _SIZES)
            plectrum.setdefault("length", f"{end * 1e3:.10g} mm")
            plectrum.setdefault("thickness", f"{(top - bottom) * 1e3:.10g} mm")
    return faults


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
        key = ".".join(path)
        for unknown in sorted(set(node) - {"value", *_ORIGIN}):
            known = near_miss(unknown, ["value", *_ORIGIN]).replace("the top level", "a quantity")
            self.faults.append((f"{key}.{unknown}", f"unknown key{known}"))
        if "assumed" in node:
            self.assumed[key] = (node["value"], node["assumed"])
        if "source" in node:
            source = self.sources[key] = node["source"]
            if not isinstance(source, str):
                self.faults.append((f"{key}.source", f"{shown(source)} is refused: give a text"))
        return node["value"]
