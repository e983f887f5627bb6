"""What a file does not tell of itself, and whoever imports it has to."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields

from sautereau.daq.errors import RecordingError


@dataclass(frozen=True)
class Answers:
    """What is known of a file beside what it tells; empty or None is not given."""

    column: Mapping[str, str] = field(default_factory=dict)
    """Column that holds a channel, by the channel's name in the rig."""
    unit: Mapping[str, str] = field(default_factory=dict)
    """Of a channel's values: volts, or what the sensor measures."""
    full_scale: Mapping[str, str] = field(default_factory=dict)
    """Quantity of a channel at the full scale of a WAV file."""
    without: tuple[str, ...] = ()
    """Channels of the rig that the file does not have."""
    time: str | None = None
    """Column of times, in s."""
    rate: str | None = None
    """Of the samples: a quantity."""
    trigger: str | None = None
    """When the trigger's edge was on the file's own axis of time, a quantity; the axis is
    that of the column of times, and else begins with the file."""
    started: str | None = None
    """When the file's axis of time was at 0: ISO 8601 with the time zone."""
    simulated: bool | None = None
    """Whether a stand-in made the samples, and no instrument."""


def refuse_answers(answers: Answers) -> None:
    """Refuse any answer, for an export by sautereau tells all of itself.

    Raises:
        RecordingError: Names those given.
    """
    given = [f.name for f in fields(Answers) if getattr(answers, f.name) not in ({}, (), None)]
    if given:
        options = ", ".join("--" + name.replace("_", "-") for name in given)
        raise RecordingError(
            f"it is an export by sautereau, which tells all of itself; leave out {options}"
        )
