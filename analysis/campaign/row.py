"""One recording as one row of a campaign's table."""

import hashlib
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from sautereau.analysis.campaign.shape import DESCRIPTORS, PLECTRUM, numbers_of
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.choirs import choirs
from sautereau.analysis.press.features import UNITS as FEATURE_UNITS
from sautereau.analysis.press.features import Row, column, split_column
from sautereau.analysis.session.analysed import AnalysedPress, analyse_file
from sautereau.rig.disk import as_text
from sautereau.rig.errors import SautereauError
from sautereau.rig.schema import Rig

if TYPE_CHECKING:
    import pyarrow as pa

LEVELS = ("soft", "medium", "hard")  # Values of the column `TOUCH`, in increasing order
TOUCH = "touch"  # Column of the judgements; null without a judgement
_LINE = re.compile(rf"^\s*touch\s*[:=]\s*({'|'.join(LEVELS)})\s*$", re.IGNORECASE | re.MULTILINE)


def touch_in(notes: str) -> str | None:
    """Return the last judgement in an operator's notes, a line such as `touch: hard`, or None."""
    found = _LINE.findall(notes)
    return found[-1].lower() if found else None


OF_STRING = (
    "plectrum",
    *(f"plectrum_{name}" for name in PLECTRUM),
    *("string_stiffness", "string_clearance"),
)  # Columns that describe the string of a pluck; those of the second pluck end in `_2`
UNITS = {
    "path": "",
    "size": "byte",
    "mtime": "ns",
    "session": "",
    "item": "1",
    "press": "1",
    "started": "",
    "warm_up": "",
    "simulated": "",
    "notes": "",
    TOUCH: "",
    "rig": "",
    "plectrum": "",
    **{f"plectrum_{name}": unit for name, unit in PLECTRUM.items()},
    "string_stiffness": "N/m",
    "string_clearance": "m",
    "jack_speed": "m/s",
    **{name: unit for name, unit in FEATURE_UNITS.items() if name not in ("path", "simulated")},
}
"""Columns in their order, with their units; the unit of text and yes/no is empty. `mtime` is the
time of the file's last change since 1970. Plectrum and string are those of the string to which the
pluck belongs, and of the rig's first string if that is unknown; with `jack_speed`, the planned
speed, their values are the rig's. The last columns are the features of
`sautereau.analysis.press.features`."""

KINDS = {
    **dict.fromkeys(("path", "session", "started", "notes", TOUCH, "rig", "plectrum"), "text"),
    **dict.fromkeys(("warm_up", "simulated"), "yes/no"),
}  # Kinds of the columns that hold no numbers
ALWAYS = (
    "path", "size", "mtime", "session", "warm_up", "simulated", "rig", "plectrum",
    *(f"plectrum_{name}" for name in PLECTRUM if name not in ("friction", *DESCRIPTORS)),
    "string_stiffness", "jack_speed",
)  # fmt: skip
"""Columns in which every press has a value."""
DESCRIBED = tuple(f"plectrum_{name}" for name in DESCRIPTORS)
"""Columns in which every press has a value, if the table has them at all."""
POSITIVE = (*ALWAYS[8:], *(n for n in DESCRIBED if n != "plectrum_taper"))
"""Those of them whose values are above 0."""
LARGEST = 1e30  # Largest magnitude of a number, in SI units. It prevents an overflow of products.


@dataclass(frozen=True)
class Source:
    """A recording in the folder."""

    path: str
    """Relative to the folder, with slashes."""
    size: int
    """File size, byte."""
    mtime: int
    """Time of the last change, ns since 1970."""


@dataclass(frozen=True)
class Fault:
    """A recording that could not be read or analysed."""

    source: Source
    text: str
    """Reason and how to fix it."""


def read_batch(folder: Path, sources: Sequence[Source]) -> tuple[list[Row], list[Fault]]:
    """Read recordings of a folder; return a row or a fault for each.

    Raises:
        AnalysisError: The folder does not exist on this machine.
    """
    if not folder.is_dir():
        raise AnalysisError(
            f"campaign of {folder}: this folder does not exist on a worker; mount it there"
            " under the same path"
        )
    rows: list[Row] = []
    faults: list[Fault] = []
    for source in sources:
        try:
            rows.append(read_row(folder, source))
        except (SautereauError, OSError) as error:
            faults.append(Fault(source, str(error)))
        except (ValueError, ArithmeticError, LookupError) as error:
            # A defect of the analysis must not stop the reading of the other recordings.
            text = f"the analysis failed: {type(error).__name__}: {error}"
            faults.append(Fault(source, f"{text}; report this defect together with the file"))
    return rows, faults


def read_row(folder: Path, source: Source) -> Row:
    """Read one recording and compute its features.

    Raises:
        sautereau.daq.errors.RecordingError: It is not a complete recording.
        AnalysisError: Its name or date cannot be stored, it holds no press, or a feature is not
            finite.
    """
    if (name := as_text(source.path)) != source.path:
        raise AnalysisError(f"recording {name}: its name is not text in UTF-8; rename the file")
    if abs(source.mtime) >= 2**63:  # the table holds it as int64
        raise AnalysisError(
            f"recording {name}: the date of its last change is not in 1678 to 2262; correct it"
        )
    found = analyse_file(folder / source.path)
    of_file: Row = {"path": source.path, "size": source.size, "mtime": source.mtime}
    row = of_file | row_of(found, Path(source.path))
    bad = [n for n, v in row.items() if isinstance(v, float) and not math.isfinite(v)]
    if bad:
        raise AnalysisError(
            f"press {folder / source.path}: {', '.join(bad)} is not a finite number; look at the"
            " recording, and repeat the press"
        )
    return row


def row_of(found: AnalysedPress, path: Path) -> Row:
    """Return a press as a row, in SI units: its session, values of its rig, and its features."""
    session, rig = found.session, found.press.rig
    row: Row = {
        "path": as_text(path.as_posix()),
        "session": session.session or as_text(path.parent.as_posix()),
        "item": session.item,
        "press": session.press,
        "started": session.started,
        "warm_up": session.warm_up,
        "simulated": found.press.simulated,
        "notes": session.notes,
        TOUCH: touch_in(session.notes),
        "rig": rig.name,
        **_of_string(rig, 1),
        "jack_speed": rig.press.jack_speed,
    }
    for pluck, held in enumerate(found.phases.plucks, 1):
        values = _of_string(rig, held.string) if held.string else {}
        row |= {column(name, pluck): value for name, value in values.items()}
    return row | {name: value for name, value in found.features.items() if name not in row}


def _of_string(rig: Rig, string: int) -> Row:
    """Return the values of the columns of `OF_STRING` for a string of the rig."""
    choir = choirs(rig)[string - 1]
    return {
        "plectrum": plectrum_id(rig, string),
        **{f"plectrum_{name}": value for name, value in numbers_of(choir.plectrum).items()},
        "string_stiffness": choir.string.static_stiffness,
        "string_clearance": choir.jack.string_clearance,
    }


def plectrum_id(rig: Rig, string: int = 1) -> str:
    """Return an identifier of a string's plectrum: eight hexadecimal digits.

    It is the same for rigs with the same name and the same values of the plectrum. Two plectra with
    equal values can be distinguished by their strings and by the names of their rigs.
    """
    plectrum = choirs(rig)[string - 1].plectrum
    # The place of the string in the model is not a property of the plectrum. Fields that earlier
    # versions did not know count where they are given, so that older tables can be continued.
    omitted = {"contact"}
    for name in ("transverse_modulus", "shear_modulus", "ageing"):
        if getattr(plectrum, name) == type(plectrum).model_fields[name].default:
            omitted.add(name)
    description = f"{rig.name}\n{plectrum.model_dump_json(exclude=omitted)}"
    description += f"\nstring {string}" * (string > 1)
    return hashlib.sha256(description.encode()).hexdigest()[:8]


def column_faults(table: "pa.Table") -> list[str]:
    """Return the faults of a table's columns: what rows of `read_row` cannot contain."""
    import pyarrow as pa

    names = table.column_names
    if len(set(names)) < len(names):
        return ["two columns have the same name"]
    required = [name for name in ALWAYS if name in names or len(table)]
    if missing := [name for name in required if name not in names]:
        return [f"no column {', '.join(missing)}"]
    required += [name for name in DESCRIBED if name in names]
    faults = [f"{n}: a press has no value" for n in required if table.column(n).null_count]
    for name, values in zip(names, table.columns, strict=True):
        kind, column_type = KINDS.get(split_column(name)[0], "number"), values.type
        right = {
            "text": pa.types.is_string,
            "yes/no": pa.types.is_boolean,
            "number": lambda t: pa.types.is_float64(t) or pa.types.is_integer(t),
        }[kind](column_type)
        if not right and not (pa.types.is_null(column_type) and name not in ALWAYS):
            faults.append(f"{name}: {column_type}, not {kind}")
        elif pa.types.is_float64(column_type):
            numbers = values.drop_null().to_numpy()
            least = 1 / LARGEST if name in POSITIVE else -LARGEST
            if not ((least <= numbers) & (numbers <= LARGEST)).all():
                faults.append(f"{name}: not numbers from {least:g} to {LARGEST:g}")
    return faults


def unit_of(column: str) -> str:
    """Return the unit of a column; empty for text and yes/no."""
    return UNITS.get(split_column(column)[0], "")


def place_of(column: str) -> tuple[int, int, str]:
    """Return the sort key of a column: the order of `UNITS`, with later plucks at the end."""
    name, pluck = split_column(column)
    place = list(UNITS).index(name) if name in UNITS else len(UNITS)
    return pluck, place, column
