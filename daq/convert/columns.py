"""The columns of an export: times, raw volts and SI values."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from sautereau.daq.convert.document import SIMULATED, volts_name
from sautereau.daq.file.recorded import Recorded, Signal
from sautereau.daq.file.samples import TOPIC, TYPES, layout_from_metadata
from sautereau.daq.signals.calibration import restored
from sautereau.rig.acquisition import Channel

TIME = "time [s]"
"""Name of the column of times after the trigger."""


@dataclass(frozen=True)
class Column:
    """One column of an export."""

    name: str
    """Name with its unit: `velocity [V]`."""
    unit: str
    what: str
    """Meaning."""
    values: NDArray[np.float64] | NDArray[np.bool_]
    """Shape (n,); a column of SI values may start later and end earlier than the recording."""
    channel: str = ""
    """Name of the channel; empty for times and `simulated`."""
    start: int = 0
    """Rows of the recording before the first value."""

    @property
    def about(self) -> dict[str, str]:
        """Unit, meaning and channel, as text."""
        found = {"unit": self.unit, "what": self.what, "channel": self.channel}
        return {key: text for key, text in found.items() if text or key != "channel"}

    @property
    def raw(self) -> bool:
        """Whether these are the raw volts of a channel."""
        return self.name == volts_name(self.channel)


def columns_of(recorded: Recorded, raw: bool) -> Iterator[Column]:
    """Yield the columns of a recording; SI values only without ``raw``."""
    n, rate = recorded.n_samples, recorded.rate
    yield Column(TIME, "s", "time after the trigger", recorded.time)
    for channel in recorded.rig.daq.channels:
        volts = recorded.volts[channel.name]
        yield Column(volts_name(channel.name), "V", "raw volts", volts, channel.name)
        if not raw:
            yield si_values(channel, volts, rate)
    if recorded.simulated:
        made = np.ones(n, dtype=bool)
        yield Column(SIMULATED, "", "the stand-in made these samples", made)


def si_values(channel: Channel, volts: Signal, rate: float) -> Column:
    """Return the SI values of a channel at the times of the rows that have one."""
    n = len(volts)
    early = min(n, ceil(max(0.0, -channel.lag * rate) - 1e-9))
    values = restored(volts, channel, rate, early)[: n - early]
    what = (
        f"scaled by {channel.scale!r} {channel.unit}/V, AC coupling of {channel.high_pass!r} Hz"
        f" inverted, delay of {channel.lag!r} s compensated"
    )
    name = f"{channel.name} [{channel.unit}]"
    if name == volts_name(channel.name):
        name = f"{channel.name}, scaled [V]"
    return Column(name, channel.unit, what, values, channel.name, early)


def counts_of(recorded: Recorded, name: str) -> tuple[NDArray[np.int_], float, float] | None:
    """Return a channel's counts, V per count and V of the count 0.

    None if the recording has volts, or if counts * V per count + V of the count 0 is not the
    volts bit for bit, as with a polynomial of higher degree.
    """
    described = recorded.channels.get(TOPIC)  # none in format 1
    layout = layout_from_metadata(described) if described else None
    if layout is None or not layout.scaling:
        return None
    offset, per_count, *higher = (*layout.scaling[layout.names.index(name)], 0.0)
    volts = recorded.volts[name]
    if not per_count or any(higher):
        return None
    counts = np.rint((volts - offset) / per_count).astype(TYPES[layout.kind])
    same = (counts * per_count + offset).view(np.uint64) == volts.view(np.uint64)
    return (counts, per_count, offset) if same.all() else None
