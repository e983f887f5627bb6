"""Designed experiments: all combinations of the levels of factors, in random order within blocks.

A block is one setting of the instrument: factors that the operator changes by hand are constant
within it, and the presses of all other combinations are in random order (a split-plot design;
Montgomery, Design and Analysis of Experiments, chapter 14). A design is a set of presses, not their
order: the folder of the session has the order in which they were planned, so that a design with
more repeats or levels adds presses behind it.
"""

import csv
import io
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from numbers import Real
from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field

from sautereau.analysis.session.conditions import differing
from sautereau.rig.document import flat, full_key, named_values, values_of
from sautereau.rig.errors import RigError
from sautereau.rig.faults import (
    bare_key,
    fault_list,
    in_text,
    model_keys,
    near_miss,
    unit_of,
    validating,
)
from sautereau.rig.layers import read_toml_file
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.schema import Rig
from sautereau.rig.units import parse_quantity
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.plan import MOST_PRESSES, MOST_ROWS, Row

RECORD = "design.csv"  # File of a session's folder with the presses of its design
Levels = tuple[tuple[str, str], ...]  # Factors with their levels, in the order of the design


@dataclass(frozen=True)
class Design:
    """Presses at all combinations of the levels of factors; `design` makes one."""

    factors: Mapping[str, Mapping[str, Mapping[str, Any] | Path]]
    """Values by dotted key, or a rig file, by factor and level."""
    repeats: int
    """Presses of each combination in each block."""
    block: tuple[str, ...]
    """Factors that are constant within a block."""
    set_ups: int
    """Blocks of each combination of the levels of `block`."""
    seed: int | None
    """Seed of the order; None for a new order in each session."""
    origin: str = "design"
    """Name in messages."""

    def __len__(self) -> int:
        """Return the number of presses."""
        return math.prod(map(len, self.factors.values())) * self.repeats * self.set_ups

    def rows(
        self, rig: Rig, planned: Iterable[Mapping[str, Any]] = (), notes: str = ""
    ) -> tuple[Row, ...]:
        """Return the presses in their order.

        Args:
            rig: The bench; the levels change its values.
            planned: Rows of the session that is continued, as JSON; they come first and in their
                order.
            notes: The operator's, for all presses.

        Raises:
            RobotError: Lists every combination that the rig does not allow, and planned presses
                that are not in the design.
        """
        cells = self._cells(rig, notes)
        earlier = [row for row in planned if isinstance(row.get("levels"), dict)]
        order = [(tuple(row["levels"].items()), row.get("block")) for row in earlier]
        left = Counter(dict.fromkeys(cells, self.repeats * self.set_ups))
        left.subtract(levels for levels, _ in order)
        if more := [levels for levels in left if left[levels] < 0]:
            names = [f"{_text(levels)}: {-left[levels]} presses more" for levels in more]
            fault = fault_list(f"{self.origin}: the session in the folder has other presses", names)
            raise RobotError(f"{fault}\nadd to a design, or give another folder (--out)")
        order += self._more(left, order[-1] if order else None, len(order))
        return tuple(replace(cells[levels], block=block) for levels, block in order)

    def _cells(self, rig: Rig, notes: str) -> dict[Levels, Row]:
        """Return the press of each combination, by its levels."""
        changed = {
            (factor, level): self._values(rig, values)
            for factor, levels in self.factors.items()
            for level, values in levels.items()
        }
        cells: dict[Levels, Row] = {}
        faults = []
        for names in product(*self.factors.values()):
            levels = tuple(zip(self.factors, names, strict=True))
            values = {key: v for each in levels for key, v in changed[each].items()}
            try:
                bench = with_values(rig, values)
            except RigError as error:
                faults.append(f"{_text(levels)}: {error}")
                continue
            cells[levels] = Row(bench, 1, values, notes, None, dict(levels))
        if faults:
            raise RobotError(fault_list(self.origin, faults))
        return cells

    @staticmethod
    def _values(rig: Rig, level: Mapping[str, Any] | Path) -> dict[str, Any]:
        """Return the values of a level; those of a rig file are its differences."""
        if not isinstance(level, Path):
            return dict(level)
        found = differing(values_of(rig), values_of(load_rig(level)))
        return {key: value for key, value in found.items() if key != "name"}

    def _more(
        self, left: Counter[Levels], last: tuple[Levels, Any] | None, planned: int
    ) -> Iterator[tuple[Levels, int]]:
        """Yield the presses that are left, in random order, with the numbers of their blocks."""
        import numpy as np

        random = np.random.default_rng(None if self.seed is None else [self.seed, planned])
        before, block = (self._by_hand(last[0]), last[1] or 0) if last else (None, 0)
        while +left:
            together: dict[Levels, list[Levels]] = {}
            for levels, number in (+left).items():
                presses = [levels] * min(number, self.repeats)
                together.setdefault(self._by_hand(levels), []).extend(presses)
            keys = list(together)
            order = [keys[i] for i in random.permutation(len(keys))]
            if order[0] == before:  # otherwise two blocks would be one setting
                order.append(order.pop(0))
            for hand in order:
                block += hand != before
                before = hand
                presses = together[hand]
                for i in random.permutation(len(presses)):
                    left[presses[i]] -= 1
                    yield presses[i], block

    def _by_hand(self, levels: Levels) -> Levels:
        return tuple((factor, level) for factor, level in levels if factor in self.block)


def design(
    factors: Mapping[str, Sequence[Any] | Mapping[str, Any]],
    repeats: int = 1,
    block: str | Iterable[str] | None = None,
    seed: int | None = None,
    set_ups: int = 1,
    *,
    origin: str = "design",
    folder: Path | None = None,
) -> Design:
    """Return the presses of an experiment: all combinations of the levels of some factors.

    Args:
        factors: Levels by factor. The levels of a key of the rig (`"press.jack_speed"` or
            `"jack_speed"`) are a list of its values. Those of a factor with a name of its own
            (`"plectrum"`) have names, each with its values of the rig by key or with a rig file, of
            which the differences from the bench's rig count.
        repeats: Presses of each combination in each block.
        block: Factors that are changed by hand: each block has one level of them. None for all
            factors that change more than the press.
        seed: Seed of the random order; None for a new one. The session keeps the order.
        set_ups: Number of blocks with the same levels, each set up again. With two or more, the
            effect of a new set-up is estimated.
        origin: Name in messages.
        folder: Folder of the rig files; None for the working directory.

    Raises:
        RobotError: Lists every fault.
    """
    faults: list[str] = []
    read = {}
    for factor, levels in factors.items():
        read[factor] = dict(_levels(factor, levels, folder or Path(), faults))
    changed = {f: {k for v in own.values() for k in _keys(v)} for f, own in read.items()}
    owners = Counter(key for keys in changed.values() for key in keys - {"*"})
    faults += [f"{k}: {n} factors change it; give it to one" for k, n in owners.items() if n > 1]
    if block is None:
        named = [f for f, keys in changed.items() if any(not k.startswith("press.") for k in keys)]
    else:
        named = [block] if isinstance(block, str) else list(block)
    faults += [
        f"block: {name} is no factor; give one of {', '.join(read)}"
        for name in named
        if name not in read
    ]
    faults += [] if read else ["no factor; give at least one with its levels"]
    for name, number in (("repeats", repeats), ("set_ups", set_ups)):
        if not 1 <= number <= MOST_PRESSES:
            faults.append(f"{name}: {number} is refused: give an integer from 1 to {MOST_PRESSES}")
    blocks = math.prod(len(read[name]) for name in named if name in read)
    if set_ups > 1 and blocks < 2:
        faults.append("set_ups: no level changes between blocks; give a block factor two levels")
    made = Design(read, repeats, tuple(named), set_ups, seed, origin)
    combinations = math.prod(map(len, read.values()))
    for number, most, what in ((combinations, MOST_ROWS, "combinations"),
                               (len(made), MOST_PRESSES, "presses")):  # fmt: skip
        if number > most:
            faults.append(f"{number} {what}, more than {most}; divide them into designs")
    if faults:
        raise RobotError(fault_list(origin, faults))
    return made


def record(rows: Sequence[Row], done: Mapping[int, str]) -> str:
    """Return the presses of a design as a CSV file.

    Args:
        done: Names of the recordings by the number of the press, from 1.
    """
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["press", "block", *rows[0].levels, "recording"])
    for number, row in enumerate(rows, 1):
        table.writerow([number, row.block, *row.levels.values(), done.get(number, "")])
    return text.getvalue()


def _levels(
    factor: str, levels: Any, folder: Path, faults: list[str]
) -> Iterator[tuple[str, Mapping[str, Any] | Path]]:
    """Yield the levels of a factor with the values that they set; adds to the faults."""
    try:
        key, why = _known(factor), ""
    except RigError as error:
        key, why = "", str(error)
    if isinstance(levels, Mapping):
        pairs = [(str(name), value) for name, value in levels.items()]
    elif isinstance(levels, Sequence) and not isinstance(levels, str):
        pairs = [(None, value) for value in levels]
    else:
        pairs = []
    if not pairs:
        faults.append(f"{factor}: no levels; give a list of values, or a table of named levels")
    seen: dict[Any, str] = {}
    for name, value in pairs:
        try:
            found = _level(key, why, value, folder)
        except RigError as error:
            faults.append(f"{factor}: {error}")
            continue
        if name is None:
            name = found.stem if isinstance(found, Path) else _name(value, found)
        own = _value(key, value) if key and isinstance(value, str) else name
        if own in seen:
            twice = f"the level {name} is given twice{f', as {seen[own]}' * (seen[own] != name)}"
            faults.append(f"{factor}: {twice}; remove one, or repeat more")
        seen[own] = name
        yield name, found


def _value(key: str, text: str) -> Any:
    """Return a quantity in its SI unit, rounded; another text, and a wrong quantity, as it is."""
    try:
        return float(f"{parse_quantity(text, unit_of(Rig, key.split('.')) or ''):.12g}")
    except ValueError:
        return text


def _name(value: Any, found: Mapping[str, Any]) -> str:
    """Return the name of a level of a list: its value as written, of a number without dust."""
    text = str(next(iter(found.values()), ""))
    number, _, unit = text.partition(" ")
    return f"{float(number):.10g} {unit}".strip() if isinstance(value, Real) and unit else text


def _level(key: str, why: str, value: Any, folder: Path) -> Mapping[str, Any] | Path:
    """Return the values of one level, or its rig file.

    Args:
        key: Key of the factor; empty for a factor with a name of its own.
        why: Why the factor's name is no key.

    Raises:
        RigError: A key is unknown, or the rig file is not valid.
    """
    if isinstance(value, Mapping):
        return named_values({_known(k): v for k, v in flat(value).items() if k}, {})
    if key:
        return named_values({key: value}, {})
    if not (isinstance(value, str | Path) and str(value).endswith(".toml")):
        raise RigError(f"{why}; or give the level a table of values, or a rig file")
    load_rig(folder / value)
    return folder / value


def _known(name: str) -> str:
    """Return the dotted key of a name.

    Raises:
        RigError: The rig has no such key.
    """
    key, known = full_key(name), list(model_keys(Rig))
    if bare_key(key) not in known:
        raise RigError(f"{name}: no such quantity in a rig{near_miss(key, known)}")
    return key


def _keys(level: Mapping[str, Any] | Path) -> set[str]:
    """Return the keys that a level changes; `*` for a rig file."""
    return {"*"} if isinstance(level, Path) else set(level)


def _text(levels: Levels) -> str:
    return ", ".join(f"{factor} = {level}" for factor, level in levels)


class _File(BaseModel, extra="forbid"):
    factors: dict[str, list[str | int | float] | dict[str, Any]] = Field(min_length=1)
    repeats: int = Field(1, ge=1)
    block: str | list[str] | None = None
    seed: int | None = Field(None, ge=0, lt=2**64)
    set_ups: int = Field(1, ge=1)


def read_design(path: Path) -> Design:
    """Read a TOML file with the arguments of `design`.

    Raises:
        RobotError: Lists every fault of the file.
    """
    origin = f"design {path}"
    text, values = read_toml_file(path, origin, RobotError)
    with validating(_File, RobotError, origin, in_text(text)):
        file = _File.model_validate(values)
    return design(
        _merged(file.factors), file.repeats, file.block, file.seed, file.set_ups,
        origin=origin, folder=path.parent,
    )  # fmt: skip


def _merged(factors: Mapping[str, Any]) -> dict[str, Any]:
    """Return factors of which dotted keys were written without quotes: `press.jack_speed = [...]`.

    TOML reads them as a table of the key's first part.
    """
    found: dict[str, Any] = {}
    for name, levels in factors.items():
        if isinstance(levels, Mapping) and all(isinstance(v, list) for v in levels.values()):
            found |= {f"{name}.{key}": values for key, values in levels.items()}
        else:
            found[name] = levels
    return found
