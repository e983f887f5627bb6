"""Make a recording of another program's file."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sautereau.daq.block import Block
from sautereau.daq.convert.answers import Answers, refuse_answers
from sautereau.daq.convert.document import Document, digest, sha256
from sautereau.daq.convert.settle import Asked, Settled, settle
from sautereau.daq.convert.source import Source, open_source
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.recorded import Event, Signal
from sautereau.daq.file.recording import Recording
from sautereau.daq.file.session_info import SessionInfo
from sautereau.daq.signals.sensors import to_volts
from sautereau.rig.schema import Rig

EVEN = 0.1
"""Steps by which a column of times may miss an even grid, for its decimals are rounded."""


@dataclass(frozen=True)
class Imported:
    """What an import has made."""

    path: Path
    """Of the recording."""
    simulated: bool
    rate: float
    """Hz."""
    n_samples: int
    first_sample: int
    """Index of the first, counted from the trigger."""
    trigger_shift: float
    """s, by which the trigger lies after sample 0, the nearest to it."""


@dataclass(frozen=True)
class _Samples:
    """What is written: volts of shape (n_channels, n), from a sample on, at a rate (Hz)."""

    volts: Signal
    first_sample: int
    rate: float
    t0_ns: int
    block: int

    def recording(self, out: Path, rig: Rig, session: SessionInfo) -> Recording:
        """Return a recording whose trigger is dated ``t0_ns``."""
        last = self.first_sample + min(self.block, self.volts.shape[1]) - 1
        arrived = self.t0_ns + round(last * 1e9 / self.rate)
        return Recording(
            out,
            rig,
            session=session,
            rate=self.rate,
            clock=lambda: arrived,
            monotonic=lambda: 0.0,
        )

    def write(self, recording: Recording) -> None:
        for at in range(0, self.volts.shape[1], self.block):
            rows = self.volts[:, at : at + self.block]
            recording.write_block(Block(self.first_sample + at, rows))

    def imported(self, out: Path, session: SessionInfo, trigger_shift: float) -> Imported:
        n, first = self.volts.shape[1], self.first_sample
        return Imported(out, session.simulated, self.rate, n, first, trigger_shift)


def import_file(
    path: Path, out: Path, *, rig: Rig | None, answers: Answers, notes: str = ""
) -> Imported:
    """Make a recording of a TDMS, CSV, WAV or Parquet file.

    An export by sautereau comes back bit for bit, with all that was recorded beside the
    samples. Of another file the samples become raw volts of the rig's channels. What the file
    does not tell has to be answered, above all whether it was measured. Nothing is overwritten,
    resampled or filled in. The session's notes and an event say what file it was, with its
    SHA-256.

    Args:
        path: Of the file.
        out: Of the recording.
        rig: The bench, with the charts of the sensors; None for an export, which holds it.
        answers: What the file does not tell.
        notes: The operator's.

    Raises:
        RecordingError: Lists all that is missing or wrong.
    """
    try:
        source = open_source(path)
        origin = f"imported from {path.name}, sha256 {sha256(path)}"
        if source.document is not None:
            refuse_answers(answers)
            return _restore(source, source.document, rig, out, notes, origin)
        if rig is None:
            raise RecordingError("which bench was it? give --rig, with the charts of its sensors")
        return _import(source, settle(source, rig, answers), answers.time, rig, out, notes, origin)
    except RecordingError as error:
        if str(error).startswith("recording "):  # of the file that is written
            raise
        raise RecordingError(f"import of {path}: {error}") from error.__cause__


def _restore(
    source: Source, document: Document, rig: Rig | None, out: Path, notes: str, origin: str
) -> Imported:
    """Write an export back as the recording that it was."""
    if rig is not None and rig != document.rig:
        raise RecordingError(
            f"it was recorded on the rig {document.rig.name!r} with other values than those of the"
            " rig given; leave out --rig: the export holds its own"
        )
    channels = document.rig.daq.channels
    columns = source.read([f"{channel.name} [V]" for channel in channels])
    if digest(list(columns.values())) != document.samples_sha256:
        raise RecordingError(
            "its volts are no longer those that sautereau exported; take it from its copy, or"
            " import it as another program's without the metadata"
        )
    session = replace(document.session, notes=_joined(document.session.notes, notes, origin))
    volts = np.stack(list(columns.values()))
    written = _Samples(
        volts, document.first_sample, document.rate, document.t0_ns, document.rig.daq.block
    )
    with written.recording(out, document.rig, session) as recording:
        written.write(recording)
        if document.plan is not None:
            plan = document.plan
            recording.write_plan(plan.t, plan.q1, plan.q2, plan.jack_rise)
        if document.joints is not None:
            recording.write_joints(document.joints)
        for event in (*document.events, _event(origin)):
            recording.event(event.kind, event.text, event.time)
    return written.imported(out, session, trigger_shift=0.0)


def _import(
    source: Source,
    settled: Settled,
    time: str | None,
    rig: Rig,
    out: Path,
    notes: str,
    origin: str,
) -> Imported:
    """Write another program's columns as raw volts."""
    asked = settled.channels
    data = source.read([*dict.fromkeys([a.column for a in asked] + ([time] if time else []))])
    lengths = {len(data[a.column]) for a in asked}
    if len(lengths) > 1 or 0 in lengths:
        found = ", ".join(f"{a.column!r} {len(data[a.column])}" for a in asked)
        raise RecordingError(
            f"its columns have the lengths {found}; give columns of one acquisition with samples"
        )
    for a in asked:
        holes = np.flatnonzero(np.isnan(data[a.column]))
        if len(holes):
            raise RecordingError(
                f"its column {a.column!r} has no number in {len(holes)} rows, the first being"
                f" {holes[0] + 1}; a hole is never filled: cut the file there"
            )
    start, rate = settled.start, settled.rate
    if time is not None:
        start, rate = _even(data[time], rate)
    if rate is None:
        raise RecordingError("what is its rate? give --rate")
    first_sample = round((start - settled.trigger) * rate)
    if first_sample > 0:
        raise RecordingError(
            f"it begins {(start - settled.trigger) * 1e3:.6g} ms after the trigger, and what came"
            " between is lost; a recording begins at the trigger or before: mend --trigger"
        )
    channels = tuple(a.channel for a in asked)
    part = rig.model_copy(update={"daq": rig.daq.model_copy(update={"channels": channels})})
    what = f"none: {origin}"
    session = SessionInfo(
        press=1,
        started=settled.started,
        simulated=settled.simulated,
        controller=what,
        daq=what,
        notes=_joined(notes, origin),
    )
    volts = np.stack([_volts(data[a.column], a) for a in asked])
    written = _Samples(volts, first_sample, rate, settled.t0_ns, rig.daq.block)
    with written.recording(out, part, session) as recording:
        written.write(recording)
        event = _event(origin)
        recording.event(event.kind, event.text, event.time)
    shift = settled.trigger - start + first_sample / rate
    return written.imported(out, session, shift)


def _volts(values: Signal, asked: Asked) -> Signal:
    scaled = values * asked.one
    return scaled if asked.in_volts else to_volts(scaled, asked.channel)


def _even(times: Signal, rate: float | None) -> tuple[float, float]:
    """Return the start (s) and the rate (Hz) of a column of times that has to be even."""
    if len(times) < 2:
        raise RecordingError("its column of times has less than two rows; give --rate instead")
    if rate is None:
        rate = float(f"{(len(times) - 1) / (times[-1] - times[0]):.9g}")
    miss = np.abs((times - times[0]) * rate - np.arange(len(times)))
    if not miss.max() <= EVEN:
        worst = int(np.argmax(~(miss <= EVEN)))
        raise RecordingError(
            f"its column of times is not even at {rate:.9g} Hz: row {worst + 1} at"
            f" {times[worst]:.9g} s is {miss[worst]:.3g} steps off; samples are missing, or the"
            " rate is another: nothing is resampled"
        )
    return float(times[0]), rate


def _event(text: str) -> Event:
    return Event(0.0, "imported", text)


def _joined(*texts: str) -> str:
    return "\n".join(text for text in texts if text)
