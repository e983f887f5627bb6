"""Go through a recording, whole or damaged, and tell what is in it."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, TypedDict

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.records import DamageError, Record
from sautereau.daq.file.container.salvage import find_whole
from sautereau.daq.file.contents import Contents
from sautereau.daq.file.integrity import check_kind, opened, size_of, verified
from sautereau.daq.file.recorded import Gap
from sautereau.daq.file.runs import Runs
from sautereau.daq.file.session_info import SessionInfo
from sautereau.rig.schema import Rig

LAYOUT = Path(__file__).parents[1] / "foxglove-layout.json"
"""Layout for Foxglove that shows the previews and the events of a recording."""


class MissingSamples(TypedDict):
    """A gap, JSON-able."""

    channel: str
    first_sample: int
    stop_sample: int | None
    """None for an end that is not known."""
    start: float
    """s, from the trigger."""
    stop: float | None
    """s, from the trigger."""


class Description(TypedDict):
    """What `describe` tells; JSON-able."""

    path: str
    size: int
    """Bytes."""
    damage: str | None
    """What is wrong with the file, and the remedy; None for one that is whole."""
    rig: str
    simulated: bool
    complete: bool
    session: dict[str, str]
    rate: float | None
    """Hz; None without samples."""
    first_sample: int
    """Index of the first sample, from the trigger."""
    n_samples: int
    """That every channel has."""
    duration: float
    """s, that they last."""
    missing: list[MissingSamples]
    channels: dict[str, dict[str, str]]
    messages: dict[str, int]
    """Count of each topic."""
    events: list[str]
    software: dict[str, str]
    recovered: dict[str, str] | None
    """From what the file was made, if it was recovered."""
    layout: str
    """Path of the layout for Foxglove."""


@dataclass(frozen=True)
class Survey:
    """What is whole in a recording."""

    damage: str | None
    contents: Contents
    runs: Runs
    rig: Rig
    session: SessionInfo

    @property
    def names(self) -> list[str]:
        """Of the channels."""
        return [channel.name for channel in self.rig.daq.channels]

    @property
    def gaps(self) -> tuple[Gap, ...]:
        """What is missing."""
        open_end = self.damage is not None or self.contents.recovered
        return self.runs.gaps(self.names, self.contents.end(), open_end=open_end)


def survey(file: BinaryIO) -> Survey:
    """Go through an open recording without keeping its samples.

    Raises:
        RecordingError: Too little of it is whole to say what it holds.
    """
    try:
        check_kind(file)
    except RecordingError as error:
        return _through(file, find_whole(file), str(error))
    try:
        return _through(file, verified(file), None)
    except DamageError as error:
        return _through(file, find_whole(file), str(error))


def _through(file: BinaryIO, records: Iterator[Record], damage: str | None) -> Survey:
    contents, runs = Contents(size_of(file)), Runs(keep=False)
    for topic, block in contents.messages(records):
        runs.add(topic, block)
    try:
        return Survey(damage, contents, runs, contents.rig(), contents.session())
    except RecordingError as error:
        if damage is None:
            raise
        raise RecordingError(
            f"{damage}; what is left does not say what was recorded: {error}"
        ) from error


def describe(path: str | Path) -> Description:
    """Tell what a recording holds, be it whole, damaged or without samples.

    Raises:
        RecordingError: The file is missing, not ours, or too little of it is whole.
    """
    path = Path(path)
    with opened(path) as file:
        found = survey(file)
        size = size_of(file)
    contents, clock = found.contents, found.runs.clock
    n_samples = sum(stop - first for first, stop in found.runs.common(found.names))
    damage, gaps = found.damage, found.gaps
    return Description(
        path=str(path),
        size=size,
        damage=damage and f"{damage}; `sautereau recover {path}` makes a whole file of the rest",
        rig=found.rig.name,
        simulated=found.session.simulated,
        complete=not damage and not gaps and all(e.kind != "aborted" for e in contents.events),
        session=found.session.to_metadata(),
        rate=clock.rate if clock else None,
        first_sample=clock.begin if clock else 0,
        n_samples=n_samples,
        duration=n_samples / clock.rate if clock else 0.0,
        missing=[missing_samples(gap) for gap in gaps],
        channels=contents.channels,
        messages={topic: contents.counts[topic] for topic in contents.channels},
        events=[f"{event.time:.6f} s {event.kind}: {event.text}" for event in contents.events],
        software=contents.metadata["software"],
        recovered=contents.metadata.get("recovered"),
        layout=str(LAYOUT),
    )


def missing_samples(gap: Gap) -> MissingSamples:
    """Return a gap for JSON."""
    return MissingSamples(
        channel=gap.channel,
        first_sample=gap.first_sample,
        stop_sample=gap.stop_sample,
        start=gap.start,
        stop=gap.stop,
    )
