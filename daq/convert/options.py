"""Options of an import, combined with what the file itself holds; or all that is missing."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from datetime import UTC, datetime

from sautereau.daq.convert.formats import SIMULATED, ImportSource
from sautereau.daq.errors import RecordingError
from sautereau.rig.acquisition import Channel
from sautereau.rig.faults import fault_list
from sautereau.rig.schema import Rig
from sautereau.rig.units import parse_quantity


@dataclass(frozen=True)
class ImportOptions:
    """What the file does not hold; an empty mapping or None is not given."""

    column: Mapping[str, str] = field(default_factory=dict)
    """Column of each channel, by the channel's name in the rig."""
    unit: Mapping[str, str] = field(default_factory=dict)
    """Unit of a channel's values: V, or a unit of the measured quantity."""
    full_scale: Mapping[str, str] = field(default_factory=dict)
    """Quantity that full scale of a WAV file stands for, by channel."""
    without: tuple[str, ...] = ()
    """Channels of the rig that the file does not have."""
    time: str | None = None
    """Column of times, in s."""
    rate: str | None = None
    """Sampling rate: a quantity."""
    trigger: str | None = None
    """Time of the trigger's edge on the file's own time axis: a quantity. The axis is the
    column of times, or starts with the first sample."""
    started: str | None = None
    """Date of time 0 of that axis: ISO 8601 with the time zone."""
    simulated: bool | None = None
    """Whether a simulation made the samples, not an instrument."""


@dataclass(frozen=True)
class ChannelColumn:
    """The column of a channel."""

    channel: Channel
    name: str
    """Name of the column."""
    unit_value: float
    """What the value 1 in the column stands for, in V or in ``channel.unit``."""
    in_volts: bool
    """Whether ``unit_value`` is in V, not in ``channel.unit``."""


@dataclass(frozen=True)
class ImportSettings:
    """Everything needed to read a file."""

    columns: tuple[ChannelColumn, ...]
    rate: float | None
    """Hz; None if it follows from the column of times."""
    trigger: float
    """Time of the trigger on the file's own time axis, s."""
    start: float
    """Time of the first sample on that axis, s, if there is no column of times."""
    t0_ns: int
    """Date of the trigger, ns since 1970."""
    started: str
    simulated: bool


def refuse_options(options: ImportOptions) -> None:
    """Refuse any option for an export by sautereau, which holds all of this itself.

    Raises:
        RecordingError: Names the options given.
    """
    given = [f.name for f in fields(options) if getattr(options, f.name) not in ({}, (), None)]
    if given:
        names = ", ".join("--" + name.replace("_", "-") for name in given)
        raise RecordingError(
            f"it is an export by sautereau, which needs no further options; remove {names}"
        )


def resolve_options(source: ImportSource, rig: Rig, options: ImportOptions) -> ImportSettings:
    """Combine what the file holds with the options.

    Raises:
        RecordingError: Lists everything that is missing, unknown or contradictory.
    """
    faults = _unknown_channels(rig, options)
    found = [_column(source, c, options, faults) for c in rig.daq.channels]
    columns = tuple(column for column in found if column is not None)
    if not faults and not columns:
        faults.append("--without names every channel; nothing would be imported")
    if options.time is not None and options.time not in source.names:
        faults.append(f"--time {options.time!r} is not a column of the file; {_columns(source)}")
    rate = _rate(source, columns, options, faults)
    if options.trigger is None:
        trigger = None
        faults.append(
            'when did the trigger occur on the file\'s own time axis? give --trigger "12 ms"'
        )
    else:
        trigger = _quantity("trigger", options.trigger, "s", "12 ms", faults)
    started = _started(source, options, faults)
    if options.simulated is None:
        faults.append("measured or simulated? give --measured or --simulated")
    elif SIMULATED in source.names and not options.simulated:
        faults.append(f"its column {SIMULATED!r} says that a stand-in made it; give --simulated")
    starts = {source.starts.get(column.name, 0.0) for column in columns}
    if len(starts) > 1:
        faults.append(
            f"its columns start at different times, {min(starts):.9g} and {max(starts):.9g} s;"
            " give columns of one acquisition"
        )
    if faults or trigger is None or started is None or options.simulated is None:
        raise RecordingError(fault_list("missing or wrong options", faults))
    since = started - datetime(1970, 1, 1, tzinfo=UTC)
    started_ns = (since.days * 86_400 + since.seconds) * 10**9 + since.microseconds * 1000
    return ImportSettings(
        columns=columns,
        rate=rate,
        trigger=trigger,
        start=starts.pop(),
        t0_ns=started_ns + round(trigger * 1e9),
        started=started.isoformat(),
        simulated=options.simulated,
    )


def _unknown_channels(rig: Rig, options: ImportOptions) -> list[str]:
    names = [channel.name for channel in rig.daq.channels]
    given = {
        "column": options.column,
        "unit": options.unit,
        "full-scale": options.full_scale,
        "without": options.without,
    }
    return [
        f"--{option}: the rig has no channel {name!r}; it has {', '.join(names)}"
        for option, channels in given.items()
        for name in channels
        if name not in names
    ]


def _column(
    source: ImportSource, channel: Channel, options: ImportOptions, faults: list[str]
) -> ChannelColumn | None:
    """Return a channel's column; None if the channel is not imported or something is wrong."""
    name = channel.name
    if name in options.without:
        if name in options.column:
            faults.append(f"{name}: both --column and --without are given; give one of them")
        return None
    column = options.column.get(name, name if name in source.names else None)
    if column is None:
        faults.append(
            f"{name}: which column? give --column.{name} NAME or --without {name};"
            f" {_columns(source)}"
        )
    elif column not in source.names:
        faults.append(
            f"{name}: --column.{name} {column!r} is not a column of the file; {_columns(source)}"
        )
        column = None
    if source.full_scale:
        option, example = f"--full-scale.{name}", '"4 V"'
        text = options.full_scale.get(name)
        if name in options.unit:
            faults.append(f"{name}: a {source.kind} file has no unit; give {option} {example}")
    else:
        option, example = f"--unit.{name}", "V"
        unit = options.unit.get(name) or source.units.get(column or "")
        text = unit and f"1 {unit}"
        if name in options.full_scale:
            faults.append(
                f"{name}: a {source.kind} file has no full scale; give {option} {example}"
            )
    if not text:
        what = "full scale" if source.full_scale else "unit"
        faults.append(f"{name}: which {what}? give {option} {example}")
        return None
    volts, si = (_value_in(text, unit) for unit in ("V", channel.unit))
    if volts is None and si is None:
        faults.append(
            f"{name}: {text!r} is neither in volts nor in {channel.unit}; give {option} {example},"
            f" or in {channel.unit}"
        )
        return None
    if column is None:
        return None
    value = volts if volts is not None else si or 0.0
    return ChannelColumn(channel, column, value, volts is not None)


def _value_in(text: str, unit: str) -> float | None:
    """Return a quantity in a unit [SI]; NI capitalises its units: Volts."""
    for spelling in (text, text.lower()):
        try:
            return parse_quantity(spelling, unit)
        except ValueError:
            continue
    return None


def _rate(
    source: ImportSource,
    columns: tuple[ChannelColumn, ...],
    options: ImportOptions,
    faults: list[str],
) -> float | None:
    names = [column.name for column in columns] or source.names
    in_file = {source.rates[name] for name in names if name in source.rates}
    if len(in_file) > 1:
        faults.append(
            f"its columns have the rates {', '.join(f'{rate:.9g} Hz' for rate in sorted(in_file))};"
            " give columns of one rate"
        )
        return None
    if options.rate is None:
        if not in_file and options.time is None:
            faults.append('which sampling rate? give --rate "51.2 kHz", or --time COLUMN')
        return next(iter(in_file), None)
    rate = _quantity("rate", options.rate, "Hz", "51.2 kHz", faults)
    if rate is not None and rate <= 0:
        faults.append(f"--rate: {options.rate!r} is not above 0 Hz; give a positive rate")
    elif rate is not None and in_file and rate not in in_file:
        faults.append(
            f"--rate {options.rate!r} differs from the file's {in_file.pop():.9g} Hz; remove --rate"
        )
    return rate


def _quantity(option: str, text: str, unit: str, example: str, faults: list[str]) -> float | None:
    try:
        return parse_quantity(text, unit)
    except ValueError as error:
        faults.append(f'--{option}: {error}; write it as "{example}"')
        return None


def _started(source: ImportSource, options: ImportOptions, faults: list[str]) -> datetime | None:
    text = options.started or source.started
    example = "--started 2026-02-03T04:05:06+01:00"
    if text is None:
        faults.append(f"which date is the file's time 0? give {example}")
        return None
    try:
        started = datetime.fromisoformat(text)
        if started.tzinfo is None:
            raise ValueError("it has no time zone")
    except ValueError as error:
        faults.append(f"--started {text!r}: {error}; write it as {example}")
        return None
    return started


def _columns(source: ImportSource) -> str:
    return f"it has {', '.join(map(repr, source.names))}"
