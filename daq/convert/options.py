"""Options of an import: facts that files of other programs do not state.

The help of the command line imports this file, so it imports nothing that is slow to load.
"""

from dataclasses import dataclass, field, fields
from typing import Any, Literal

MODIFIED = "modified"  # Value of `started`: the date of the file's last change


@dataclass(frozen=True)
class ImportOptions:
    """Facts that the file does not state; an empty value means that none is given."""

    column: dict[str, str] = field(default_factory=dict)
    """Column of a channel: --column.velocity NAME. Default: the column with the channel's name."""
    unit: dict[str, str] = field(default_factory=dict)
    """Unit of a channel's values: --unit.velocity V, or mm/s."""
    full_scale: dict[str, str] = field(default_factory=dict)
    """Full scale of a WAV file's channel: --full-scale.velocity "100 mm/s", or "4 V"."""
    without: tuple[str, ...] = ()
    """Channel of the rig that the file does not contain. Repeat it for several."""
    invert: tuple[str, ...] = ()
    """Channel whose sensor has the opposite sign. Repeat it for several."""
    time: str | None = None
    """Column of times, or of ISO 8601 dates."""
    time_unit: str | None = None
    """Unit of the column of times: ms. Default: the unit in the file, or s."""
    rate: str | None = None
    """Sample rate: "51.2 kHz"."""
    trigger: str | None = None
    """Time of the trigger: "12 ms" in the column of times, or after the start of the file."""
    started: str | None = None
    """Date of the file's time 0: 2026-02-03T04:05:06+01:00, or "modified", the date of the file."""
    decimal: Literal[",", "."] | None = None
    """Decimal sign of a text table. Default: the one that its numbers show."""
    skip: int | None = None
    """Lines of a text table before its first row. Default: those before the rows of numbers."""
    simulated: bool | None = None
    """Whether the data were simulated, or measured on an instrument."""
    complete: bool | None = None
    """The file is complete, although its last line has no line end, or it states more or fewer
    rows."""

    def given(self) -> dict[str, Any]:
        """Return the options that differ from their defaults, by name."""
        default = ImportOptions()
        every = ((one.name, getattr(self, one.name)) for one in fields(ImportOptions))
        return {name: value for name, value in every if value != getattr(default, name)}
