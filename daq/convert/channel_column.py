"""The column of an imported file that holds a channel, and the meaning of its values."""

from dataclasses import dataclass

from sautereau.daq.convert.formats import ImportSource
from sautereau.daq.convert.options import ImportOptions
from sautereau.daq.convert.preamble import is_unit, value_in
from sautereau.rig.acquisition import Channel


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


def column_of(
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
            f"{name}: its column is missing; give --column.{name} NAME or --without {name};"
            f" {names_of(source)}"
        )
    elif column not in source.names:
        faults.append(
            f"{name}: --column.{name} {column!r} is not a column of the file; {names_of(source)}"
        )
        return None
    unit = _unit_value(source, channel, column, options, faults)
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
        faults.append(f"{name}: its {what} is missing; give {option} {example}")
        return None
    integral = {"m/s": "m"}.get(channel.unit)
    for possible in filter(None, ("V", channel.unit, integral)):
        value = value_in(text, possible)
        if value is not None:
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
