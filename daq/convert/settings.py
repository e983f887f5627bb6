"""Settings of an import, from the options and the file; an error lists all that is missing."""

import re
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import combinations

from sautereau.daq.convert.document import SIMULATED
from sautereau.daq.convert.formats import ImportSource
from sautereau.daq.convert.options import MODIFIED, ImportOptions
from sautereau.daq.convert.preamble import is_unit, value_in
from sautereau.daq.convert.times import UNIX
from sautereau.daq.errors import RecordingError
from sautereau.rig.acquisition import Channel
from sautereau.rig.faults import fault_list
from sautereau.rig.schema import Rig
from sautereau.rig.units import parse_quantity


@dataclass(frozen=True)
class ChannelColumn:
    """The column of a channel."""

    channel: Channel
    name: str
    """Name of the column."""
    unit_value: float
    """Quantity of the value 1 in the column, in V, in ``channel.unit`` or in m; negative for an
    inverted sensor."""
    unit: str
    """V, ``channel.unit``, or m for the displacement whose derivative the channel measures."""


@dataclass(frozen=True)
class ImportSettings:
    """Everything needed to read a file."""

    columns: tuple[ChannelColumn, ...]
    rate: float | None
    """Hz, of --rate; None if it is not given."""
    stated: float | None
    """Hz, in the file; None if it is not there."""
    time_unit: float
    """Duration of the value 1 in the column of times, s."""
    trigger: float
    """Time of the trigger on the file's own time axis, s."""
    start: float
    """Time of the first sample on that axis, s, if there is no column of times."""
    t0_ns: int
    """Date of the trigger, ns since 1970."""
    started: str
    simulated: bool
    warnings: tuple[str, ...]
    """Statements of the file that an option replaces."""


def resolve_options(
    source: ImportSource, rig: Rig, options: ImportOptions, modified: float
) -> ImportSettings:
    """Combine what the file holds with the options.

    Args:
        rig: The rig with its channels.
        modified: Date of the file's last change, s since 1970.

    Raises:
        RecordingError: Lists everything that is missing, unknown or contradictory.
    """
    faults = _unknown_channels(rig, options)
    warnings: list[str] = []
    found = [column_of(source, c, options, faults, warnings) for c in rig.daq.channels]
    columns = tuple(column for column in found if column is not None)
    for first, second in combinations(columns, 2):
        if first.name == second.name:
            faults.append(
                f"{second.channel.name}: its column {second.name!r} is that of"
                f" {first.channel.name}; give another one, or --without"
            )
    if not faults and not columns:
        faults.append("--without names every channel; nothing would be imported")
    if options.time is not None and options.time not in source.names:
        faults.append(f"--time {options.time!r} is not a column of the file; {names_of(source)}")
    rate, stated = _rate(source, columns, options, faults, warnings)
    time_unit = _time_unit(source, options, faults)
    if source.cut and not options.complete:
        faults.append(f"{source.cut}; if the file is complete, give --complete")
    trigger = _trigger(options, faults)
    imported = [column.name for column in columns] + ([options.time] if options.time else [])
    dates = sorted({source.dates[name] for name in imported if name in source.dates})
    started = _started(source, dates, options, modified, faults, warnings)
    if options.simulated is None:
        faults.append("it may be measured or simulated; give --measured or --simulated")
    elif SIMULATED in source.names and not options.simulated:
        faults.append(f"its column {SIMULATED!r} says that a stand-in made it; give --simulated")
    starts = {source.starts.get(column.name, 0.0) for column in columns}
    if len(starts) > 1:
        faults.append(
            f"its columns start at different times, {min(starts):.9g} and {max(starts):.9g} s;"
            " give columns of one acquisition"
        )
    if (
        faults
        or trigger is None
        or started is None
        or time_unit is None
        or options.simulated is None
    ):
        raise RecordingError(fault_list("missing or wrong options", faults))
    since = started - datetime(1970, 1, 1, tzinfo=UTC)
    started_ns = (since.days * 86_400 + since.seconds) * 10**9 + since.microseconds * 1000
    return ImportSettings(
        columns=columns,
        rate=rate,
        stated=stated,
        time_unit=time_unit,
        trigger=trigger,
        start=starts.pop(),
        t0_ns=started_ns + round(trigger * 1e9),
        started=started.isoformat(),
        simulated=options.simulated,
        warnings=tuple(warnings),
    )


def named_columns(source: ImportSource, options: ImportOptions) -> ImportOptions:
    """Return options in which columns have the names of the file."""
    columns = {name: _named(source, column) or column for name, column in options.column.items()}
    return replace(
        options,
        column=columns,
        time=options.time and (_named(source, options.time) or options.time),
    )


def _named(source: ImportSource, name: str) -> str | None:
    """Return the column with a name, or with that before its unit: `velocity [mm/s]`."""
    alike = [n for n in source.names if re.split(r"\s*[\[(/]", n)[0].lower() == name.lower()]
    return name if name in source.names else alike[0] if len(alike) == 1 else None


def _unknown_channels(rig: Rig, options: ImportOptions) -> list[str]:
    names = [channel.name for channel in rig.daq.channels]
    given = {
        "column": options.column,
        "unit": options.unit,
        "full-scale": options.full_scale,
        "without": options.without,
        "invert": options.invert,
    }
    return [
        f"--{option}: the rig has no channel {name!r}; it has {', '.join(names)}"
        for option, channels in given.items()
        for name in channels
        if name not in names
    ]


def column_of(
    source: ImportSource,
    channel: Channel,
    options: ImportOptions,
    faults: list[str],
    warnings: list[str],
) -> ChannelColumn | None:
    """Return a channel's column; None if the channel is not imported or something is wrong."""
    name = channel.name
    if name in options.without:
        if name in options.column:
            faults.append(f"{name}: both --column and --without are given; give one of them")
        return None
    column = options.column.get(name) or _named(source, name)
    if column is None:
        faults.append(
            f"{name}: its column is missing; give --column.{name} NAME or --without {name};"
            f" {names_of(source)}"
        )
    elif column not in source.names:
        faults.append(
            f"{name}: --column.{name} {column!r} is not a column of the file; {names_of(source)}"
        )
        return None
    unit = _unit_value(source, channel, column, options, faults, warnings)
    if column is None or unit is None:
        return None
    sign = -1 if name in options.invert else 1
    return ChannelColumn(channel, column, sign * unit[0], unit[1])


def _unit_value(
    source: ImportSource,
    channel: Channel,
    column: str | None,
    options: ImportOptions,
    faults: list[str],
    warnings: list[str],
) -> tuple[float, str] | None:
    """Return the quantity of the value 1 in a channel's column, and its unit."""
    name, column_unit = channel.name, source.units.get(column or "", "")
    if source.full_scale:
        what, example = "full scale", '"4 V"'
        text, useless = options.full_scale.get(name), options.unit
    else:
        what, example = "unit", "V"
        unit = options.unit.get(name) or (column_unit if is_unit(column_unit) else "")
        text, useless = unit and f"1 {unit}", options.full_scale
    option = f"--{what.replace(' ', '-')}.{name}"
    if name in useless:
        lacking = "unit" if source.full_scale else "full scale"
        faults.append(f"{name}: a {source.kind} file has no {lacking}; give {option} {example}")
    if not text:
        unknown = " or unknown" * (column is not None and not source.full_scale)
        faults.append(f"{name}: its {what} is missing{unknown}; give {option} {example}")
        return None
    integral = {"m/s": "m"}.get(channel.unit)
    for possible in filter(None, ("V", channel.unit, integral)):
        value = value_in(text, possible)
        if value is not None:
            stated = is_unit(column_unit) and not source.full_scale
            if stated and value_in(f"1 {column_unit}", possible) != value:
                warnings.append(
                    f"{option} {text[2:]!r} replaces the unit that the file states, {column_unit}"
                )
            return value, possible
    also = f" nor, as a displacement, in {integral}" if integral else ""
    faults.append(
        f"{name}: {text!r} is neither in volts nor in {channel.unit}{also}; give {option}"
        f" {example}, or in {channel.unit}"
    )
    return None


def names_of(source: ImportSource) -> str:
    """Return the end of a message that lists a file's columns."""
    return f"it has {', '.join(map(repr, source.names))}"


def _rate(
    source: ImportSource,
    columns: tuple[ChannelColumn, ...],
    options: ImportOptions,
    faults: list[str],
    warnings: list[str],
) -> tuple[float | None, float | None]:
    """Return the rate that is given, and the one that the file states."""
    names = [column.name for column in columns] or source.names
    in_file = sorted({source.rates[name] for name in names if name in source.rates})
    listed = ", ".join(f"{rate:.9g} Hz" for rate in in_file)
    if options.rate is None:
        if not in_file and options.time is None:
            faults.append('the sampling rate is missing; give --rate "51.2 kHz", or --time COLUMN')
        if len(in_file) > 1:
            faults.append(
                f"its columns have the rates {listed}; give columns of one rate, or --rate"
            )
        return None, next(iter(in_file), None)
    rate = _quantity("rate", options.rate, "Hz", "51.2 kHz", faults)
    if rate is not None and rate <= 0:
        faults.append(f"--rate: {options.rate!r} is not above 0 Hz; give a positive rate")
    elif in_file and in_file != [rate]:
        warnings.append(f"--rate {options.rate!r} replaces the rate that the file states, {listed}")
    return rate, None


def _quantity(option: str, text: str, unit: str, example: str, faults: list[str]) -> float | None:
    try:
        return parse_quantity(text, unit)
    except ValueError as error:
        faults.append(f'--{option}: {error}; write it as "{example}"')
        return None


def _started(
    source: ImportSource,
    dates: list[str],
    options: ImportOptions,
    modified: float,
    faults: list[str],
    warnings: list[str],
) -> datetime | None:
    """Return the date of the file's time 0.

    Args:
        dates: Those of the columns that are imported.
    """
    text = options.started or next(iter(dates), source.started)
    if len(dates) > 1:
        listed = f"its columns start at different dates, {' and '.join(dates)}"
        if options.started is None:
            faults.append(f"{listed}; give columns of one acquisition, or --started")
        else:
            warnings.append(f"--started {options.started!r} replaces {listed.removeprefix('its ')}")
    if text == MODIFIED:
        return datetime.fromtimestamp(modified, UTC)
    example = "--started 2026-02-03T04:05:06+01:00"
    if text is None and options.time is not None:
        text = _unix_date(source, options)
    if text is None:
        faults.append(f"the date of the file's time 0 is missing; give {example}")
        return None
    try:
        started = datetime.fromisoformat(text)
        if started.tzinfo is None:
            raise ValueError("it has no time zone")
    except ValueError as error:
        faults.append(f"--started {text!r}: {error}; write it as {example}")
        return None
    return started


def _unix_date(source: ImportSource, options: ImportOptions) -> str | None:
    """Return the date of the first row if the column of times is in s since 1970."""
    unit = value_in(f"1 {_unit_of_times(source, options)}", "s")
    if options.time not in source.names or unit is None:
        return None
    first = source.read([options.time])[options.time][0] * unit
    return datetime.fromtimestamp(first, UTC).isoformat() if UNIX[0] <= first < UNIX[1] else None


def _unit_of_times(source: ImportSource, options: ImportOptions) -> str:
    return options.time_unit or source.units.get(options.time or "", "s")


def _time_unit(source: ImportSource, options: ImportOptions, faults: list[str]) -> float | None:
    unit = _unit_of_times(source, options)
    if options.time_unit is not None and options.time is None:
        faults.append("--time-unit is given without --time; give both or neither")
    value = value_in(f"1 {unit}", "s") if is_unit(unit) else None
    if value is None:
        faults.append(f"--time-unit: {unit!r} is not a unit of time; give s, ms or us")
    return value


def _trigger(options: ImportOptions, faults: list[str]) -> float | None:
    if options.trigger is None:
        faults.append(
            'the time of the trigger on the file\'s time axis is missing; give --trigger "12 ms"'
        )
        return None
    trigger = _quantity("trigger", options.trigger, "s", "12 ms", faults)
    if trigger is not None and abs(trigger) > 1e9:
        faults.append(
            f"--trigger: {trigger:g} s is more than 1e+09 s; give the time of the trigger on the"
            " file's time axis, and its date as --started"
        )
    return trigger
