"""Options of an import: what the files of other programs do not hold."""

from pydantic import BaseModel

from sautereau.daq.errors import RecordingError

MODIFIED = "modified"
"""Value of `started`: the date of the file's last change."""


class ImportOptions(BaseModel, frozen=True, extra="forbid", strict=True):
    """What the file does not hold; an empty mapping or None is not given."""

    column: dict[str, str] = {}
    """Column of each channel, by the channel's name in the rig."""
    unit: dict[str, str] = {}
    """Unit of a channel's values: V, or a unit of the measured quantity."""
    full_scale: dict[str, str] = {}
    """Quantity that full scale of a WAV file stands for, by channel."""
    without: tuple[str, ...] = ()
    """Channels of the rig that the file does not have."""
    invert: tuple[str, ...] = ()
    """Channels whose sensor has the opposite sign."""
    time: str | None = None
    """Column of times."""
    time_unit: str | None = None
    """Unit of the column of times; s where neither this nor the file gives it."""
    rate: str | None = None
    """Sampling rate: a quantity."""
    trigger: str | None = None
    """Time of the trigger's edge on the file's own time axis: a quantity. The axis is the
    column of times, or starts with the first sample."""
    started: str | None = None
    """Date of time 0 of that axis: ISO 8601 with the time zone, or `MODIFIED`."""
    simulated: bool | None = None
    """Whether a simulation made the samples, not an instrument."""
    complete: bool | None = None
    """Whether the file is complete although its last line has no line end."""


def refuse_options(options: ImportOptions) -> None:
    """Refuse any option for an export by sautereau, which holds all of this itself.

    Raises:
        RecordingError: Names the options given.
    """
    if given := options.model_dump(exclude_defaults=True):
        names = ", ".join("--" + name.replace("_", "-") for name in given)
        raise RecordingError(
            f"it is an export by sautereau, which needs no further options; remove {names}"
        )
