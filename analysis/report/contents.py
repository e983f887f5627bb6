"""What a report tells of: every press of a session, analysed and thinned out for drawing."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.predict import Prediction, predict
from sautereau.analysis.phases import Phases, find_phases
from sautereau.analysis.press.features import Features, features
from sautereau.analysis.press.load import Press, press_of
from sautereau.analysis.report.differences import values_of
from sautereau.analysis.report.envelope import envelope
from sautereau.analysis.report.slow_motion import SlowMotion, slow_motion
from sautereau.analysis.session.compare import Comparison, compare
from sautereau.analysis.session.compare_features import ComparedFeature, compare_features
from sautereau.analysis.session.repeatability import LEAST, Repeatability, repeatability
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import Event, Recorded
from sautereau.daq.file.session_info import SessionInfo
from sautereau.rig.errors import SautereauError
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats
from sautereau.trajectory.timing import press_law

POINTS = 50_000
"""Of all traces together: half a megabyte of the page."""
LEAST_POINTS, MOST_POINTS = 250, 1200
"""Of one trace."""
COLUMNS = ("deflection", "jack_speed", "force")
"""Of a press, that are drawn over time."""
BESIDE = 5e-3
"""s, before contact and after release, that force on deflection is drawn of."""


@dataclass(frozen=True)
class Trace:
    """What is drawn of one signal."""

    x: Floats
    """s from the trigger, or m from contact; shape (n,)."""
    y: Floats
    """In SI; shape (n,)."""


@dataclass(frozen=True)
class PressRecord:
    """One press as the report needs it."""

    number: int
    """Of the press on the page, from 1, in the order in which they were made."""
    path: Path
    digest: str
    """SHA-256 of the file."""
    session: SessionInfo
    software: Mapping[str, str]
    events: tuple[Event, ...]
    rig: Rig
    press: Press
    """Its data are only the jack's rise over the cruise, for the figures of repeatability."""
    phases: Phases
    features: Features
    traces: Mapping[str, Trace]
    """Of `COLUMNS`; empty where the press is not drawn."""
    held: Trace | None
    """Force on deflection about the first pluck, both in SI; None without one, or not drawn."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """All that is doubtful about it."""
        aborted = tuple(f"{e.kind}: {e.text}" for e in self.events if e.kind in _FAULTS)
        return (*aborted, *self.press.warnings, *self.phases.warnings)


_FAULTS = ("aborted", "fault")
"""Kinds of events that a reader has to know of first."""


@dataclass(frozen=True)
class Condition:
    """Presses made alike, and what they say together."""

    rig: Rig
    changed: Mapping[str, Any]
    """Where its rig differs from that of the first condition, by dotted key."""
    presses: tuple[PressRecord, ...]
    prediction: Prediction | None
    comparison: Comparison | None
    features: tuple[ComparedFeature, ...]
    """Beside the model's."""
    repeatability: Repeatability | None
    warnings: tuple[str, ...]
    """Why one of them is missing."""


@dataclass(frozen=True)
class Contents:
    """A session's presses."""

    conditions: tuple[Condition, ...]
    unread: Mapping[Path, str]
    """Why a recording is left out."""
    points: int
    """Of one trace."""
    rate: float
    """Hz, of the samples of which a trace is made."""
    slow_motion: SlowMotion | None
    """Of the first press with a pluck."""
    no_slow_motion: str
    """Why there is none; empty where there is one."""

    @property
    def presses(self) -> tuple[PressRecord, ...]:
        """All of them, in the order in which they were made."""
        every = [record for condition in self.conditions for record in condition.presses]
        return tuple(sorted(every, key=lambda record: record.number))


def gather(paths: Sequence[Path], level: str, step: Callable[[], Any] = lambda: None) -> Contents:
    """Read and analyse the recordings of a session.

    Args:
        paths: Of the recordings, in the order in which they were made.
        level: Of the plectrum's model.
        step: Called after each of them.

    Raises:
        AnalysisError: None of them can be read.
    """
    each = POINTS // (len(COLUMNS) * max(1, len(paths)))
    points = min(MOST_POINTS, max(LEAST_POINTS, each))
    every = max(1, -(-LEAST_POINTS * len(COLUMNS) * len(paths) // POINTS))
    records: list[PressRecord] = []
    unread: dict[Path, str] = {}
    shown: SlowMotion | None = None
    not_shown = ""
    for number, path in enumerate(paths, 1):
        try:
            recorded = read_recording(path)
            press = press_of(recorded)
            phases = find_phases(press)
            drawn = points if (number - 1) % every == 0 else 0
            records.append(_record(path, number, recorded, press, phases, drawn))
            if phases.plucks and not (shown or not_shown):
                shown, not_shown = _shown(number, press, phases)
        except SautereauError as error:
            unread[path] = str(error)
        step()
    if not records:
        told = next(iter(unread.values()), "there is none; give the folder of a session")
        raise AnalysisError(f"report: no recording of {len(paths)} can be read: {told}")
    base = values_of(records[0].rig)
    parted: dict[str, list[PressRecord]] = {}
    for record in records:
        parted.setdefault(repr(values_of(record.rig)), []).append(record)
    return Contents(
        tuple(_condition(alike, base, level) for alike in parted.values()),
        unread,
        points,
        records[0].press.rate,
        shown,
        "" if shown else not_shown or "no press has a pluck",
    )


def _shown(number: int, press: Press, phases: Phases) -> tuple[SlowMotion | None, str]:
    """Return the press in slow motion, or why it cannot be shown so."""
    try:
        return slow_motion(number, press, phases), ""
    except SautereauError as error:
        return None, str(error)


def _record(
    path: Path, number: int, recorded: Recorded, press: Press, phases: Phases, points: int
) -> PressRecord:
    """Return what the page needs of one recording; with no points it is not drawn."""
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
        path=path,
        digest=hashlib.sha256(path.read_bytes()).hexdigest(),
        session=recorded.session,
        software=recorded.software,
        events=recorded.events,
        rig=press.rig,
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
    """Return what presses made alike say together, those for warming up left out."""
    rig = records[0].rig
    counted = [record for record in records if not record.session.warm_up]
    prediction = comparison = spread = None
    compared: tuple[ComparedFeature, ...] = ()
    warnings = []
    try:
        prediction = predict(rig, level)
        comparison = compare([record.phases for record in counted], prediction)
        compared = compare_features([record.features for record in counted], rig, prediction)
    except SautereauError as error:
        warnings.append(f"no comparison with the model: {error}")
    if len(counted) >= LEAST and rig.press.gesture is None:
        try:
            spread = repeatability([r.press for r in counted], press_law(rig.press))
        except AnalysisError as error:
            warnings.append(f"no figures of repeatability: {error}")
    own = values_of(rig)
    changed = {key: own.get(key) for key in [*base, *own] if own.get(key) != base.get(key)}
    return Condition(
        rig,
        changed,
        tuple(records),
        prediction,
        comparison,
        compared,
        spread,
        tuple(warnings),
    )
