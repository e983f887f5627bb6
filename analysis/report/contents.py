"""Contents of a report: every press of a session, analysed, and decimated for the plots."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.press import Press, press_of
from sautereau.analysis.model.predict import Prediction, predict
from sautereau.analysis.phases import Phases, find_phases
from sautereau.analysis.press.features import Row, features
from sautereau.analysis.report.drawing import envelope
from sautereau.analysis.report.slow_motion import SlowMotion, slow_motion
from sautereau.analysis.session.compare import (
    ComparedFeature,
    Comparison,
    compare,
    compare_features,
    predict_each,
)
from sautereau.analysis.session.repeatability import LEAST, Repeatability, repeatability
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import Event, Recorded, SessionInfo
from sautereau.rig.errors import SautereauError
from sautereau.rig.load import rig_document
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.timing import press_law

POINTS = 50_000
"""Total number of points of all traces: half a megabyte of the page."""
LEAST_POINTS, MOST_POINTS = 250, 1200
"""Number of points of one trace."""
COLUMNS = ("deflection", "jack_speed", "force")
"""Columns of a press that are drawn over time."""
BESIDE = 5e-3
"""s, before contact and after release, shown in the plot of force over deflection."""


@dataclass(frozen=True)
class Trace:
    """The points of one signal that are drawn."""

    x: Floats
    """Time after the trigger (s), or deflection from contact (m); shape (n,)."""
    y: Floats
    """Signal in SI units; shape (n,)."""


@dataclass(frozen=True)
class PressRecord:
    """One press of the report."""

    number: int
    """Number of the press on the page, from 1, in the order in which they were made."""
    digest: str
    """SHA-256 of the file."""
    session: SessionInfo
    software: Mapping[str, str]
    events: tuple[Event, ...]
    press: Press
    """Its data are reduced to the jack rise over the cruise, for the repeatability."""
    phases: Phases
    features: Row
    traces: Mapping[str, Trace]
    """By the names in `COLUMNS`; empty if the press is not drawn."""
    held: Trace | None
    """Force over deflection around the first pluck; None without one, or if not drawn."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the press, its faults first."""
        aborted = tuple(f"{e.kind}: {e.text}" for e in self.events if e.kind in _FAULTS)
        return (*aborted, *self.press.warnings, *self.phases.warnings)


_FAULTS = ("aborted", "fault")
"""Kinds of events that are warnings."""
_ADDRESSES = (("controller", "port"), ("daq", "address"))
"""Rig keys of the devices' addresses, which are no condition of a press."""


@dataclass(frozen=True)
class Condition:
    """Presses of one rig, with their comparison and repeatability."""

    rig: Rig
    changed: Mapping[str, Any]
    """Values of its rig that differ from the first condition's, by dotted key."""
    presses: tuple[PressRecord, ...]
    prediction: Prediction | None
    comparison: Comparison | None
    features: tuple[ComparedFeature, ...]
    """Features with the model's values."""
    repeatability: Repeatability | None
    warnings: tuple[str, ...]
    """Reasons for a missing comparison or repeatability."""


@dataclass(frozen=True)
class Contents:
    """Presses of a session."""

    conditions: tuple[Condition, ...]
    unread: Mapping[Path, str]
    """Reason why a recording could not be read, by its path."""
    points: int
    """Number of points of one trace."""
    rate: float
    """Hz, sampling rate of the recordings."""
    slow_motion: SlowMotion | None
    """The first press with a pluck."""
    no_slow_motion: str
    """Reason why there is no slow motion; empty if there is one."""

    @property
    def presses(self) -> tuple[PressRecord, ...]:
        """All presses, in the order in which they were made."""
        every = [record for condition in self.conditions for record in condition.presses]
        return tuple(sorted(every, key=lambda record: record.number))


def gather(paths: Sequence[Path], level: str, step: Callable[[], Any] = lambda: None) -> Contents:
    """Read and analyse the recordings of a session.

    Args:
        paths: Recordings, in the order in which they were made.
        level: Level of the plectrum's bending model.
        step: Called after each recording.

    Raises:
        AnalysisError: None of them can be read.
    """
    each = POINTS // (len(COLUMNS) * max(1, len(paths)))
    points = min(MOST_POINTS, max(LEAST_POINTS, each))
    every = max(1, -(-LEAST_POINTS * len(COLUMNS) * len(paths) // POINTS))
    records: list[PressRecord] = []
    unread: dict[Path, str] = {}
    shown: SlowMotion | None = None
    reason = ""
    for number, path in enumerate(paths, 1):
        try:
            recorded = read_recording(path)
            press = press_of(recorded)
            phases = find_phases(press)
            drawn = points if (number - 1) % every == 0 else 0
            records.append(_record(number, recorded, press, phases, drawn))
            if phases.plucks and not (shown or reason):
                try:
                    shown = slow_motion(number, press, phases)
                except SautereauError as error:
                    reason = str(error)
        except SautereauError as error:
            unread[path] = str(error)
        step()
    if not records:
        first = next(iter(unread.values()), "there is none; give the folder of a session")
        raise AnalysisError(f"report: no recording of {len(paths)} can be read: {first}")
    base = values_of(records[0].press.rig)
    by_rig: dict[str, list[PressRecord]] = {}
    for record in records:
        by_rig.setdefault(repr(values_of(record.press.rig)), []).append(record)
    return Contents(
        tuple(_condition(of_one_rig, base, level) for of_one_rig in by_rig.values()),
        unread,
        points,
        records[0].press.rate,
        shown,
        "" if shown else reason or "no press has a pluck",
    )


def _record(
    number: int, recorded: Recorded, press: Press, phases: Phases, points: int
) -> PressRecord:
    """Return the record of one press; with 0 points it is not drawn."""
    time = press.data.index.to_numpy()
    traces: dict[str, Trace] = {}
    for column in COLUMNS if points else ():
        signal = press.data[column].to_numpy()
        kept = envelope(signal, points)
        traces[column] = Trace(time[kept], signal[kept])
    law = press_law(press.rig.press)
    cruise = slice(law.cruise_start - 1e-3, law.cruise_end + 1e-3)
    return PressRecord(
        number=number,
        digest=hashlib.sha256(press.path.read_bytes()).hexdigest(),
        session=recorded.session,
        software=recorded.software,
        events=recorded.events,
        press=replace(press, data=press.data.loc[cruise, ["jack_rise"]].copy()),
        phases=phases,
        features=features(press, phases),
        traces=traces,
        held=_held(press, phases, points // 2) if points else None,
    )


def _held(press: Press, phases: Phases, points: int) -> Trace | None:
    if not phases.plucks:
        return None
    first = phases.plucks[0]
    end = min(first.release + BESIDE, phases.bottom)
    deflection, force = press.from_contact(first.contact, first.contact - BESIDE, end)
    kept = envelope(force, points)
    return Trace(deflection[kept], force[kept])


def _condition(records: list[PressRecord], base: Mapping[str, Any], level: str) -> Condition:
    """Return the comparison and repeatability of presses of one rig, without warm-up presses."""
    rig = records[0].press.rig
    counted = [record for record in records if not record.session.warm_up]
    prediction = comparison = spread = None
    compared: tuple[ComparedFeature, ...] = ()
    warnings = []
    try:
        prediction = predict(rig, level)
        phases = [record.phases for record in counted]
        each = predict_each([record.press for record in counted], phases, rig, level)
        comparison = compare(phases, each)
        compared = compare_features([record.features for record in counted], rig, each)
    except SautereauError as error:
        warnings.append(f"no comparison with the model: {error}")
    if len(counted) >= LEAST and rig.press.gesture is None:
        try:
            spread = repeatability([r.press for r in counted], press_law(rig.press))
        except AnalysisError as error:
            warnings.append(f"no repeatability: {error}")
    own = values_of(rig)
    changed = {key: own.get(key) for key in [*base, *own] if own.get(key) != base.get(key)}
    found = (prediction, comparison, compared, spread, tuple(warnings))
    return Condition(rig, changed, tuple(records), *found)


def values_of(rig: Rig) -> dict[str, Any]:
    """Return the values of a rig by dotted key, without the devices' addresses."""
    document = rig_document(rig)
    for section, name in _ADDRESSES:
        del document[section][name]
    return dict(_flat(document, ""))


def _flat(node: Any, at: str) -> list[tuple[str, Any]]:
    if isinstance(node, Mapping) and node:
        parts = node.items()
    elif isinstance(node, list) and node and isinstance(node[0], Mapping):
        parts = enumerate(node)
    else:
        return [(at, node)]
    dot = f"{at}." if at else ""
    return [pair for key, value in parts for pair in _flat(value, f"{dot}{key}")]
