"""Contents of a report: every press of a session, analysed, and decimated for the plots."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.report.pictures import envelope
from sautereau.analysis.report.slow_motion import SlowMotion, slow_motion
from sautereau.analysis.session.analysed import AnalysedPress, analyse_recording
from sautereau.analysis.session.conditions import SessionAnalysis, analyse
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import Event, Recorded
from sautereau.rig.disk import digest
from sautereau.rig.errors import SautereauError
from sautereau.rig.progress import tracked
from sautereau.trajectory.motion import Floats

POINTS = 50_000  # Total number of points of all traces: half a megabyte of the page
LEAST_POINTS = 250  # Smallest number of points of one trace
COLUMNS = ("deflection", "jack_speed", "force")  # Columns of a press that are drawn over time
BESIDE = 5e-3  # s, before contact and after release, shown in the plot of force over deflection


@dataclass(frozen=True)
class Trace:
    """The points of one signal that are drawn."""

    x: Floats
    """Time after the trigger (s), or deflection from contact (m); shape (n,)."""
    y: Floats
    """Signal in SI units; shape (n,)."""


@dataclass(frozen=True)
class PressRecord(AnalysedPress):
    """One press of the report, without the samples that the page does not need."""

    number: int
    """Number of the press on the page, from 1, in the order in which they were made."""
    digest: str
    """SHA-256 of the file."""
    software: Mapping[str, str]
    events: tuple[Event, ...]
    traces: Mapping[str, Trace]
    """By the names in `COLUMNS`; empty if the press is not drawn."""
    held: Mapping[int, Trace]
    """Force over deflection around the pluck of each string, by its number; empty if not drawn."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the press, its faults first."""
        aborted = tuple(f"{e.kind}: {e.text}" for e in self.events if e.kind in _FAULTS)
        return (*aborted, *super().warnings)


_FAULTS = ("aborted", "fault")  # Kinds of events that are warnings


@dataclass(frozen=True)
class Contents(SessionAnalysis[PressRecord]):
    """Presses of a session by condition."""

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


def gather(paths: Sequence[Path], level: str) -> Contents:
    """Read and analyse the recordings of a session.

    Raises:
        AnalysisError: None of them can be read.
    """
    each = POINTS // (len(COLUMNS) * max(1, len(paths)))
    points = min(1200, max(LEAST_POINTS, each))
    every = max(1, -(-LEAST_POINTS * len(COLUMNS) * len(paths) // POINTS))
    records: list[PressRecord] = []
    unread: dict[Path, str] = {}
    shown: SlowMotion | None = None
    reason = ""
    for number, path in enumerate(tracked(paths), 1):
        try:
            recorded = read_recording(path)
            analysed = analyse_recording(recorded)
            drawn = points if (number - 1) % every == 0 else 0
            records.append(_record(number, recorded, analysed, drawn))
            if analysed.phases.plucks and not (shown or reason):
                try:
                    shown = slow_motion(number, analysed.press, analysed.phases)
                except SautereauError as error:
                    reason = str(error)
        except SautereauError as error:
            unread[path] = str(error)
    if not records:
        first = next(iter(unread.values()), "there is none; give the folder of a session")
        raise AnalysisError(f"report: no recording of {len(paths)} can be read: {first}")
    missing = "" if shown else reason or "no press has a pluck"
    analysis = analyse(records, level)
    return Contents(
        **vars(analysis), unread=unread, points=points, rate=records[0].press.rate,
        slow_motion=shown, no_slow_motion=missing,
    )  # fmt: skip


def _record(number: int, recorded: Recorded, whole: AnalysedPress, points: int) -> PressRecord:
    """Return the record of one press; with 0 points it is not drawn."""
    press = whole.press
    traces: dict[str, Trace] = {}
    for column in COLUMNS if points else ():
        signal = press.samples[column]
        kept = envelope(signal, points)
        traces[column] = Trace(press.time[kept], signal[kept])
    held: dict[int, Trace] = {}
    for pluck in whole.phases.plucks if points else ():
        if pluck.string:
            end = min(pluck.release + BESIDE, whole.phases.bottom)
            deflection, force = press.from_contact(pluck.contact, pluck.contact - BESIDE, end)
            kept = envelope(force, points // 2)
            held[pluck.string] = Trace(deflection[kept], force[kept])
    return PressRecord(
        **vars(whole.light()),
        number=number,
        digest=digest(recorded.path),
        software=recorded.software,
        events=recorded.events,
        traces=traces,
        held=held,
    )
