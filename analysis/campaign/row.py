"""One recording as one row of a campaign's table."""

import hashlib
import re
from dataclasses import dataclass
from pathlib import Path

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.phases import find_phases
from sautereau.analysis.press.features import UNITS as FEATURE_UNITS
from sautereau.analysis.press.features import Value, features
from sautereau.analysis.press.load import press_of
from sautereau.daq.file.reading import read_recording
from sautereau.rig.errors import SautereauError
from sautereau.rig.schema import Rig

Row = dict[str, Value]
"""One press; columns of `UNITS`, without those that it has no value for."""

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
    "rig": "",
    "plectrum": "",
    "plectrum_length": "m",
    "plectrum_width": "m",
    "plectrum_thickness": "m",
    "plectrum_overlap": "m",
    "plectrum_youngs_modulus": "Pa",
    "plectrum_bending_stiffness": "N m^2",
    "plectrum_friction": "1",
    "string_stiffness": "N/m",
    "string_clearance": "m",
    "jack_speed": "m/s",
    **{name: unit for name, unit in FEATURE_UNITS.items() if name not in ("path", "simulated")},
}
"""Of the columns, in their order; empty for text and truths. `mtime` is since 1970, when the file
was last changed; `jack_speed` is the planned one, as all that the rig says; the features are
those of `sautereau.analysis.press.features`."""
_LATER = re.compile(r"_\d+$")
"""What the columns of a second pluck and of later ones end in."""


@dataclass(frozen=True)
class Source:
    """A recording as it was found in the folder."""

    path: str
    """Below the folder, with slashes."""
    size: int
    """byte."""
    mtime: int
    """ns since 1970, when it was last changed."""


@dataclass(frozen=True)
class Fault:
    """A recording that gives no row."""

    source: Source
    text: str
    """Why not, and what to do."""


@dataclass(frozen=True)
class Batch:
    """Recordings that are read together; travels to the process that reads them."""

    folder: Path
    sources: tuple[Source, ...]


def read_batch(batch: Batch) -> tuple[list[Row], list[Fault]]:
    """Read recordings, each a row or a fault.

    Raises:
        AnalysisError: None of them is there: this machine does not see the folder.
    """
    if not batch.folder.is_dir():
        raise AnalysisError(
            f"campaign of {batch.folder}: a worker does not see that folder; mount it there"
            " under the same path"
        )
    rows: list[Row] = []
    faults: list[Fault] = []
    for source in batch.sources:
        try:
            rows.append(read_row(batch.folder, source))
        except (SautereauError, OSError) as error:
            faults.append(Fault(source, str(error)))
        except (ValueError, ArithmeticError, LookupError) as error:
            # Ours, but no reason to leave thousands of others unread.
            text = f"the analysis failed on it: {type(error).__name__}: {error}"
            faults.append(Fault(source, f"{text}; report it together with the file"))
    return rows, faults


def read_row(folder: Path, source: Source) -> Row:
    """Read one recording and find its features.

    Raises:
        daq.errors.RecordingError: It is not a whole recording.
        AnalysisError: It gives no press, or its features are not numbers.
    """
    recorded = read_recording(folder / source.path)
    press = press_of(recorded)
    found = features(press, find_phases(press)).row()
    session = recorded.session
    row: Row = {
        "path": source.path,
        "size": source.size,
        "mtime": source.mtime,
        "session": session.session or Path(source.path).parent.as_posix(),
        "item": session.item,
        "press": session.press,
        "started": session.started,
        "warm_up": session.warm_up,
        "simulated": recorded.simulated,
        "notes": session.notes,
        "rig": recorded.rig.name,
        "plectrum": plectrum_id(recorded.rig),
        **_rig_columns(recorded.rig),
    }
    row |= {name: value for name, value in found.items() if name not in row}
    _check(row, folder / source.path)
    return row


def plectrum_id(rig: Rig) -> str:
    """Return a short name of the plectrum that a rig describes: equal for equal descriptions.

    Two plectra whose rigs say the same of them, down to the rigs' names, are taken for one.
    """
    said = f"{rig.name}\n{rig.plectrum.model_dump_json()}"
    return hashlib.sha256(said.encode()).hexdigest()[:8]


def unit_of(column: str) -> str:
    """Return the unit of a column; empty for text and truths."""
    return UNITS.get(column) or UNITS.get(_LATER.sub("", column), "")


def place_of(column: str) -> tuple[int, int, str]:
    """Return what the columns are sorted by: later plucks last, else as in `UNITS`."""
    later = _LATER.search(column)
    name = _LATER.sub("", column)
    place = list(UNITS).index(name) if name in UNITS else len(UNITS)
    return int(later[0][1:]) if later else 1, place, column


def _rig_columns(rig: Rig) -> Row:
    plectrum = rig.plectrum
    return {
        "plectrum_length": plectrum.length,
        "plectrum_width": plectrum.width,
        "plectrum_thickness": plectrum.thickness,
        "plectrum_overlap": plectrum.overlap,
        "plectrum_youngs_modulus": plectrum.youngs_modulus,
        "plectrum_bending_stiffness": plectrum.bending_stiffness,
        "plectrum_friction": plectrum.friction,
        "string_stiffness": rig.string.static_stiffness,
        "string_clearance": rig.jack.string_clearance,
        "jack_speed": rig.press.jack_speed,
    }


def _check(row: Row, path: Path) -> None:
    """Refuse what is no number: a table of features has none."""
    bad = [n for n, v in row.items() if isinstance(v, float) and not abs(v) < float("inf")]
    if bad:
        raise AnalysisError(
            f"press {path}: {', '.join(bad)} came out as no finite number; look at the recording,"
            " and press again"
        )
