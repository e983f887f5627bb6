"""Import: make a recording of another program's file, or of an export.

Values that suggest an inverted sensor, a wrong unit or a channel without a signal are reported.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from sautereau.daq.convert.document import Document, digest, volts_name
from sautereau.daq.convert.formats import Columns, ImportSource, open_source, refuse_missing
from sautereau.daq.convert.options import ImportOptions
from sautereau.daq.convert.settings import (
    ChannelColumn,
    ImportSettings,
    named_columns,
    resolve_options,
)
from sautereau.daq.convert.times import PLAUSIBLE, UNIX, own_axis, start_and_rate
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.limits import FARTHEST_SAMPLE, time_faults
from sautereau.daq.file.recorded import (
    SPLIT,
    Block,
    Event,
    Joints,
    Plan,
    Recorded,
    SessionInfo,
    Signal,
)
from sautereau.daq.file.recording import Recording
from sautereau.daq.signals.calibration import to_volts
from sautereau.rig import disk
from sautereau.rig.acquisition import MEASURED, Channel
from sautereau.rig.disk import as_text
from sautereau.rig.faults import fault_list
from sautereau.rig.schema import Rig

ENDING = ".importing.part"  # Appended to the name of a recording until its import is complete
SMOOTHED = 5
"""Number of samples that a polynomial of degree 4 is fitted to, to differentiate a displacement."""
LIMITS = {"velocity": (1e-4, 10.0), "force": (1e-3, 200.0)}
"""Smallest and largest plausible magnitude of a press, SI units, by quantity."""


@dataclass(frozen=True)
class Imported:
    """Result of an import."""

    path: Path
    """The recording."""
    simulated: bool
    rate: float
    """Hz."""
    n_samples: int
    first_sample: int
    """Index of the first sample, counted from the trigger."""
    trigger_shift: float
    """Time from sample 0, the nearest to the trigger, to the trigger, s."""
    warnings: tuple[str, ...] = ()
    """Doubts about the samples, each with how to fix it."""
    read_as: str = ""
    """How the file was read, where it does not state its layout."""


def import_file(
    path: Path, out: Path, *, rig: Rig | None, options: ImportOptions, notes: str = ""
) -> Imported:
    """Make a recording of a file in one of the registered formats.

    An export by sautereau is restored bit for bit, with everything that was recorded besides
    the samples. The samples of another file become raw volts of the rig's channels. What the
    file does not hold must be given, above all whether it was measured. Nothing is overwritten,
    resampled or filled in. The session's notes and an event name the file and its SHA-256.

    Args:
        rig: The rig with the sensors' calibrations; None for an export, which holds it.
        options: What the file does not hold.

    Raises:
        RecordingError: Lists everything that is missing or wrong.
    """
    try:
        names = [channel.name for channel in rig.daq.channels] if rig else []
        columns = [options.column.get(n, n) for n in names if n not in options.without]
        source = open_source(path, options, columns + ([options.time] if options.time else []))
        origin = f"imported from {path.name}, sha256 {disk.digest(path)}"
        if source.document is not None:
            if given := options.given():
                names = ", ".join("--" + name.replace("_", "-") for name in given)
                raise RecordingError(
                    f"it is an export by sautereau, which needs no further options; remove {names}"
                )
            return _restore(source, source.document, rig, out, notes, origin)
        if rig is None:
            raise RecordingError("--rig is required: it holds the sensors' calibrations")
        options = named_columns(source, options)
        settings = resolve_options(source, rig, options, path.stat().st_mtime)
        return _import(source, settings, options, rig, out, notes, origin)
    except RecordingError as error:
        if str(error).startswith("recording "):  # the fault is in the file to write
            raise
        raise RecordingError(f"import of {path}: {error}") from error.__cause__


def _restore(
    source: ImportSource, document: Document, rig: Rig | None, out: Path, notes: str, origin: str
) -> Imported:
    """Write the recording from which an export was made."""
    if rig is not None and rig != document.rig:
        raise RecordingError(
            f"it was recorded on the rig {document.rig.name!r} with other values than those of"
            " --rig; remove --rig: the export holds its own"
        )
    names = [volts_name(channel.name) for channel in document.rig.daq.channels]
    if missing := [name for name in names if name not in source.names]:
        raise RecordingError(f"it lacks the columns {', '.join(missing)}; use a copy of it")
    columns = source.read(names)
    if digest(list(columns.values())) != document.samples_sha256:
        raise RecordingError(
            "its volts differ from those that sautereau exported; use a copy of it, or import it"
            " without its metadata, as a file of another program"
        )
    session = replace(document.session, notes=_joined(document.session.notes, notes, origin))
    volts, first = np.stack(list(columns.values())), document.first_sample
    rig, rate = document.rig, document.rate
    events = (*document.events, Event(0.0, "imported", origin))
    moved, t0 = (document.plan, document.joints), (document.t0_ns, document.t0_std)
    _write(out, rig, session, volts, first, rate, events, *t0, *moved)
    return Imported(out, session.simulated, document.rate, volts.shape[1], first, 0.0)


def _import(
    source: ImportSource,
    settings: ImportSettings,
    options: ImportOptions,
    rig: Rig,
    out: Path,
    notes: str,
    origin: str,
) -> Imported:
    """Write another program's columns as raw volts."""
    columns, time = settings.columns, options.time
    data = source.read([*dict.fromkeys([c.name for c in columns] + ([time] if time else []))])
    lengths = {name: len(values) for name, values in data.items()}
    if len({*lengths.values()}) > 1 or 0 in lengths.values():
        listed = ", ".join(f"{name!r} {length}" for name, length in lengths.items())
        raise RecordingError(
            f"its columns have the lengths {listed}; give columns of one acquisition with samples"
        )
    for name, values in data.items():
        refuse_missing(name, ~np.isfinite(values), source.where)
    start, rate, warnings, read_as = _time_axis(source, settings, options, data)
    place = (start - settings.trigger) * rate
    if not abs(place) <= FARTHEST_SAMPLE:
        raise RecordingError(
            f"its first sample is {place:.3g} samples from the trigger, beyond FARTHEST_SAMPLE ="
            f" {FARTHEST_SAMPLE}; correct --trigger, the rate or the times"
        )
    first = round(place)
    if first > 0:
        raise RecordingError(
            f"it starts {(start - settings.trigger) * 1e3:.6g} ms after the trigger, so the samples"
            " between are missing; a recording starts at the trigger or before: correct --trigger"
        )
    part = rig.replaced({"daq.channels": tuple(column.channel for column in columns)})
    device = f"none: {origin}"
    session = SessionInfo(
        press=1,
        started=settings.started,
        simulated=settings.simulated,
        controller=device,
        daq=device,
        notes=_joined(notes, origin),
    )
    volts = np.stack([_volts(data[column.name], column, rate) for column in columns])
    for column, values in zip(columns, volts, strict=True):
        refuse_missing(column.name, ~np.isfinite(values), source.where)
        warnings += doubts(values, column.channel)
        if column.unit == "m":
            warnings.append(f"{column.channel.name}: derivative of the displacement in the file")
    read = f"{origin}; read as: {read_as}" if read_as else origin
    events = [Event(0.0, "warning", warning) for warning in warnings]
    events.append(Event(0.0, "imported", read))
    _write(out, part, session, volts, first, rate, events, settings.t0_ns)
    shift = settings.trigger - start + first / rate
    made = out, session.simulated, rate, volts.shape[1], first, shift
    return Imported(*made, tuple(warnings), read_as)


def _time_axis(
    source: ImportSource, settings: ImportSettings, options: ImportOptions, data: Columns
) -> tuple[float, float, list[str], str]:
    """Return the start (s) and the rate (Hz) of the samples, warnings, and how the file is read."""
    warnings, read_as, time = [*settings.warnings], source.guess, options.time
    start, rate = settings.start, settings.rate or settings.stated
    rows = len(data[settings.columns[0].name])
    if source.rows not in (None, rows):
        stated = f"states {source.rows} rows, and there are {rows}"
        if not options.complete:
            raise RecordingError(
                f"it {stated}; use a complete copy, or give --complete if no rows are missing"
            )
        warnings.append(f"the file {stated}; --complete was given")
    if time is not None:
        times = data[time]
        if UNIX[0] <= times[0] * settings.time_unit < UNIX[1]:
            times = times - times[0]
            read_as = "; ".join(filter(None, (read_as, f"{time!r} as the time since 1970")))
        times = times * settings.time_unit
        start, rate, doubted = start_and_rate(times, settings.rate, settings.stated, source)
        warnings += doubted
        for column in settings.columns:
            own = own_axis(source, column.name, time)
            if own and not np.array_equal(source.read([own])[own], data[time]):
                raise RecordingError(
                    f"column {column.name!r} has its own times in {own!r}, which differ from those"
                    f" in {time!r}; import it separately with --time {own!r}, or give --rate and no"
                    " --time"
                )
    if rate is None:
        raise RecordingError("the sampling rate is missing; give --rate")
    if not PLAUSIBLE[0] <= rate <= PLAUSIBLE[1]:
        warnings.append(
            f"unusual rate of {rate:.6g} Hz, outside {PLAUSIBLE[0]:g} Hz to {PLAUSIBLE[1]:g} Hz;"
            " check --rate and --time-unit"
        )
    return start, rate, warnings, read_as


def _volts(values: Signal, column: ChannelColumn, rate: float) -> Signal:
    with np.errstate(over="ignore", invalid="ignore"):  # refused by the caller
        scaled = values * column.unit_value
        if column.unit == "m":
            from scipy.signal import savgol_filter

            if len(scaled) < SMOOTHED:
                raise RecordingError(
                    f"column {column.name!r} has {len(scaled)} rows, and the derivative of a"
                    f" displacement needs {SMOOTHED}; give more rows"
                )
            scaled = np.asarray(savgol_filter(scaled, SMOOTHED, 4, deriv=1, delta=1 / rate), float)
        return scaled if column.unit == "V" else to_volts(scaled, column.channel)


def _joined(*texts: str) -> str:
    return "\n".join(text for text in texts if text)


def doubts(volts: Signal, channel: Channel) -> list[str]:
    """Return what is implausible in the samples of a channel, and how to fix it.

    The key goes down first and the finger presses on it, so the first large deviation from rest
    is positive for velocity and force.

    Args:
        volts: Shape (n_samples,), V.
    """
    name, unit = channel.name, channel.unit
    values = volts * channel.scale
    if np.ptp(values) == 0:
        return [
            f"{name}: all samples are {values[0]:.6g} {unit}; check --column.{name} and the sensor"
        ]
    found = []
    if (most := float(np.abs(volts).max())) > channel.range:
        found.append(
            f"{name}: reaches {most:.5g} V, beyond the range of {channel.range:.5g} V in the rig;"
            f" check --unit.{name}, and scale and range of the rig's channel"
        )
    if channel.quantity not in LIMITS:
        return found
    least, limit = LIMITS[channel.quantity]
    largest = float(np.abs(values).max())
    if not least <= largest <= limit:
        found.append(
            f"{name}: reaches {largest:.5g} {unit}, which is implausible: a press reaches"
            f" {least:g} to {limit:g} {unit}; check --unit.{name} and --column.{name}"
        )
    # A velocity has no offset that matters here, and a file may start in motion.
    rest = 0.0 if channel.quantity == "velocity" else np.median(values[: _share(0.02, values)])
    if _first_sign(values - rest) < 0:
        found.append(
            f"{name}: the first large deviation from rest is negative, and positive means that"
            f" {MEASURED.get(channel.quantity).positive}: the sensor seems inverted; if so,"
            f" import again with --invert {name}"
        )
    return found


def _first_sign(moved: Signal) -> float:
    """Return the sign of the first large deviation from rest."""
    magnitude = np.abs(moved)
    first = int(np.argmax(magnitude > 0.3 * np.quantile(magnitude, 0.999)))  # The key moves
    return float(np.sign(moved[first : first + _share(0.005, moved)].mean()))


def _share(fraction: float, values: Signal) -> int:
    return max(1, round(fraction * len(values)))


def _write(
    out: Path,
    rig: Rig,
    session: SessionInfo,
    volts: Signal,
    first: int,
    rate: float,
    events: Iterable[Event],
    t0_ns: int,
    t0_std: float | None = None,
    plan: Plan | None = None,
    joints: Joints | None = None,
) -> None:
    """Write a recording; after an error none is left: the samples are in the file it is made of.

    Args:
        volts: V, shape (n_channels, n_samples).
        first: Index of the first sample, counted from the trigger.
        rate: Hz.
        t0_ns: Date of the trigger, ns since 1970.
        t0_std: Its standard uncertainty, s; None if it is unknown.
    """
    ends = (first, first + volts.shape[1])
    if faults := time_faults(t0_ns, rate, *ends):
        raise RecordingError(f"{fault_list('its samples', faults)}; correct the rate or --started")
    if any(t0_ns + n * 1e9 / rate < 0 for n in ends):
        raise RecordingError(
            f"at {rate:.6g} Hz, its {volts.shape[1]} samples from sample {first} on reach beyond"
            " the dates from 1970 to 2262; correct the rate, --trigger or --started"
        )
    recording = Recording(
        out,
        rig,
        session=session,
        rate=rate,
        t0_ns=t0_ns,
        t0_std=t0_std,
        monotonic=lambda: 0.0,
        ending=ENDING,
    )
    with recording:
        for at in range(0, volts.shape[1], rig.daq.block):
            recording.write_block(Block(first + at, volts[:, at : at + rig.daq.block]))
        if plan is not None:
            recording.write_plan(plan.t, plan.q1, plan.q2, plan.jack_rise)
        if joints is not None:
            recording.write_joints(joints)
        for event in events:
            recording.event(event.kind, event.text, event.time, event.std)


OF_ALL = ("imported", "warning")  # Events about all samples of a file


def write_part(recorded: Recorded, start: int, stop: int, out: Path, press: int) -> None:
    """Write consecutive samples of a recording, bit for bit, with the events during them.

    Time 0 of the new recording is its first sample. Its notes and an event state where it was in
    the other one.

    Args:
        start: Index of the first sample, counted from the first of the recording.
        stop: Index after the last.
        press: Number of the press.

    Raises:
        RecordingError: An arm has made the recording, so that all of it is one press; or the new
            one cannot be written.
    """
    if recorded.arm is not None or recorded.motion is not None:
        raise RecordingError(
            f"recording {recorded.path}: it holds the motion of an arm, and thus one press; it is"
            " not split"
        )
    rate, first = recorded.rate, recorded.first_sample + start
    begin, end = first / rate, (recorded.first_sample + stop) / rate
    text = (
        f"samples {first} to {recorded.first_sample + stop - 1} of {as_text(recorded.path.name)}:"
        f" time 0 is {begin:.9g} s after its trigger"
    )
    events = [
        replace(event, time=0.0 if event.kind in OF_ALL else event.time - begin)
        for event in recorded.events_and_gaps
        if event.kind in OF_ALL or begin <= event.time <= end
    ]
    session = replace(
        recorded.session,
        press=press,
        started=_later(recorded.session.started, begin),
        notes=_joined(recorded.session.notes, text),
    )
    volts = np.stack([recorded.volts[c.name][start:stop] for c in recorded.rig.daq.channels])
    t0_ns = recorded.t0_ns + round(begin * 1e9)
    events.append(Event(0.0, SPLIT, text))
    _write(out, recorded.rig, session, volts, 0, rate, events, t0_ns, recorded.t0_std)


def _later(date: str, seconds: float) -> str:
    """Return an ISO date some seconds later; another text unchanged."""
    try:
        return (datetime.fromisoformat(date) + timedelta(seconds=seconds)).isoformat()
    except (ValueError, OverflowError):
        return date
