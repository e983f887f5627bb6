"""Put together what a file tells and what was answered, or say all that is missing."""

from dataclasses import dataclass
from datetime import UTC, datetime

from sautereau.daq.convert.answers import Answers
from sautereau.daq.convert.source import SIMULATED, Source
from sautereau.daq.errors import RecordingError
from sautereau.rig.acquisition import Channel
from sautereau.rig.faults import fault_list
from sautereau.rig.schema import Rig
from sautereau.rig.units import parse_quantity


@dataclass(frozen=True)
class Asked:
    """A channel to be read."""

    channel: Channel
    column: str
    one: float
    """What a value of 1 in the column is."""
    in_volts: bool
    """Whether that is in V, and not in ``channel.unit``."""


@dataclass(frozen=True)
class Settled:
    """All that is needed to read a file."""

    channels: tuple[Asked, ...]
    rate: float | None
    """Hz; None where the column of times tells it."""
    trigger: float
    """s, on the file's own axis of time."""
    start: float
    """s, of the first sample there, where no column of times tells it."""
    t0_ns: int
    """ns since 1970 of the trigger."""
    started: str
    simulated: bool


def settle(source: Source, rig: Rig, answers: Answers) -> Settled:
    """Put together what the file tells and what was answered.

    Raises:
        RecordingError: Lists all that is missing, unknown or contradictory.
    """
    faults = _unknown_channels(rig, answers)
    asked = [_asked(source, c, answers, faults) for c in rig.daq.channels]
    channels = tuple(a for a in asked if a is not None)
    if not faults and not channels:
        faults.append("every channel is left out; nothing would be imported")
    if answers.time is not None and answers.time not in source.names:
        faults.append(f"--time {answers.time!r} is no column of it; {_columns(source)}")
    rate = _rate(source, channels, answers, faults)
    trigger = _quantity(
        "trigger",
        answers.trigger,
        "s",
        "12 ms",
        "when did the trigger come, on the file's own axis of time",
        faults,
    )
    started = _started(source, answers, faults)
    if answers.simulated is None:
        faults.append("did an instrument or a simulation make it? give --measured or --simulated")
    elif SIMULATED in source.names and not answers.simulated:
        faults.append(f"its column {SIMULATED!r} says that a stand-in made it; give --simulated")
    starts = {source.starts.get(a.column, 0.0) for a in channels}
    if len(starts) > 1:
        faults.append(
            f"its columns start at different times, {min(starts):.9g} and {max(starts):.9g} s;"
            " give columns of one acquisition"
        )
    if faults or trigger is None or started is None or answers.simulated is None:
        raise RecordingError(fault_list("what is missing or wrong", faults))
    since = started - datetime(1970, 1, 1, tzinfo=UTC)
    whole = (since.days * 86_400 + since.seconds) * 10**9 + since.microseconds * 1000
    return Settled(
        channels=channels,
        rate=rate,
        trigger=trigger,
        start=starts.pop(),
        t0_ns=whole + round(trigger * 1e9),
        started=started.isoformat(),
        simulated=answers.simulated,
    )


def _unknown_channels(rig: Rig, answers: Answers) -> list[str]:
    names = [channel.name for channel in rig.daq.channels]
    given = {
        "column": answers.column,
        "unit": answers.unit,
        "full-scale": answers.full_scale,
        "without": answers.without,
    }
    return [
        f"--{option}: the rig has no channel {name!r}; it has {', '.join(names)}"
        for option, channels in given.items()
        for name in channels
        if name not in names
    ]


def _asked(source: Source, channel: Channel, answers: Answers, faults: list[str]) -> Asked | None:
    """Return how a channel is read; None where it is left out or something is wrong."""
    name = channel.name
    if name in answers.without:
        if name in answers.column:
            faults.append(f"{name}: it has a column and is left out; give one of the two")
        return None
    column = answers.column.get(name, name if name in source.names else None)
    if column is None:
        faults.append(
            f"{name}: which column is it? give --column.{name} NAME or --without {name};"
            f" {_columns(source)}"
        )
    elif column not in source.names:
        faults.append(f"{name}: --column.{name} {column!r} is no column of it; {_columns(source)}")
        column = None
    if source.full_scale:
        option, example = f"--full-scale.{name}", '"4 V"'
        text = answers.full_scale.get(name)
        if name in answers.unit:
            faults.append(f"{name}: a {source.kind} file has no unit; give {option} {example}")
    else:
        option, example = f"--unit.{name}", "V"
        unit = answers.unit.get(name) or source.units.get(column or "")
        text = unit and f"1 {unit}"
        if name in answers.full_scale:
            faults.append(
                f"{name}: a {source.kind} file has no full scale; give {option} {example}"
            )
    if not text:
        what = "full scale" if source.full_scale else "unit"
        faults.append(f"{name}: what is its {what}? give {option} {example}")
        return None
    volts, si = (_of_one(text, unit) for unit in ("V", channel.unit))
    if volts is None and si is None:
        faults.append(
            f"{name}: {text!r} is neither volts nor {channel.unit}; give {option} {example}, or"
            f" in {channel.unit}"
        )
        return None
    if column is None:
        return None
    return Asked(channel, column, volts if volts is not None else si or 0.0, volts is not None)


def _of_one(text: str, unit: str) -> float | None:
    """Return a quantity in a unit [SI]; NI writes its units with a capital, Volts."""
    for spelt in (text, text.lower()):
        try:
            return parse_quantity(spelt, unit)
        except ValueError:
            continue
    return None


def _rate(
    source: Source, channels: tuple[Asked, ...], answers: Answers, faults: list[str]
) -> float | None:
    columns = [a.column for a in channels] or source.names
    told = {source.rates[column] for column in columns if column in source.rates}
    if len(told) > 1:
        faults.append(
            f"its columns have the rates {', '.join(f'{rate:.9g} Hz' for rate in sorted(told))};"
            " give columns of one rate"
        )
        return None
    if answers.rate is None:
        if not told and answers.time is None:
            faults.append('what is its rate? give --rate "51.2 kHz", or --time COLUMN')
        return next(iter(told), None)
    rate = _quantity("rate", answers.rate, "Hz", "51.2 kHz", "", faults)
    if rate is not None and told and rate not in told:
        faults.append(
            f"--rate {answers.rate!r} is not the {told.pop():.9g} Hz that the file tells; leave it"
            " out"
        )
    return rate


def _quantity(
    option: str, text: str | None, unit: str, example: str, question: str, faults: list[str]
) -> float | None:
    if text is None:
        faults.append(f'{question}? give --{option} "{example}"')
        return None
    try:
        value = parse_quantity(text, unit)
        if option == "rate" and value <= 0:
            raise ValueError(f"{text!r} is not above 0")
    except ValueError as error:
        faults.append(f'--{option}: {error}; write it like "{example}"')
        return None
    return value


def _started(source: Source, answers: Answers, faults: list[str]) -> datetime | None:
    text = answers.started or source.started
    example = "--started 2026-02-03T04:05:06+01:00"
    if text is None:
        faults.append(f"when was the file's time 0? give {example}")
        return None
    try:
        started = datetime.fromisoformat(text)
        if started.tzinfo is None:
            raise ValueError("it has no time zone")
    except ValueError as error:
        faults.append(f"--started {text!r}: {error}; write it like {example}")
        return None
    return started


def _columns(source: Source) -> str:
    return f"it has {', '.join(map(repr, source.names))}"
