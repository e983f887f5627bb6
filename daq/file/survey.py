"""Describe what a recording holds, whether it is damaged or not."""

from collections.abc import Iterator
from dataclasses import dataclass
from io import BufferedReader
from pathlib import Path
from typing import Any, TypedDict

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.chunks import find_intact
from sautereau.daq.file.container.records import DamageError, Opcode, Record
from sautereau.daq.file.contents import Contents
from sautereau.daq.file.integrity import check_header, has_data_crc, opened, size_of, verifying
from sautereau.daq.file.recorded import Gap, SessionInfo
from sautereau.daq.file.runs import Runs
from sautereau.rig.schema import Rig

LAYOUT = Path(__file__).parents[1] / "foxglove-layout.json"
"""Layout for Foxglove that shows the previews and the events of a recording."""


class Description(TypedDict):
    """Result of `describe`, which can be written as JSON."""

    path: str
    size: int
    """Size in bytes."""
    damage: str | None
    """What is wrong with the file, and how to fix it; None if it is undamaged."""
    rig: str
    simulated: bool
    complete: bool
    session: dict[str, str]
    rate: float | None
    """Sampling rate, Hz; None without samples."""
    first_sample: int
    """Index of the first sample, counted from the trigger."""
    n_samples: int
    """Number of samples that every channel has."""
    duration: float
    """Their duration, s."""
    missing: list[dict[str, Any]]
    """Gaps, each as `Gap.document` returns it."""
    channels: dict[str, dict[str, str]]
    messages: dict[str, int]
    """Number of messages, by topic."""
    events: list[str]
    software: dict[str, str]
    t0_ns: int | None
    """Date of the trigger by the host's clock, ns since 1970; None without samples."""
    t0_std: float | None
    """Its standard uncertainty, s; None if it is unknown."""
    checked: bool
    """Whether checksums cover the samples; another program may have written the file without."""
    recovered: dict[str, str] | None
    """File that this one was recovered from, its damage and what is missing; None otherwise."""
    layout: str
    """Path of the layout for Foxglove."""


@dataclass(frozen=True)
class Survey:
    """The intact content of a recording, without its samples."""

    damage: str | None
    contents: Contents
    runs: Runs
    rig: Rig
    session: SessionInfo
    checked: bool

    @property
    def names(self) -> list[str]:
        """Names of the channels."""
        return [channel.name for channel in self.rig.daq.channels]

    @property
    def gaps(self) -> tuple[Gap, ...]:
        """Missing samples."""
        open_end = self.damage is not None or self.contents.recovered
        return self.runs.gaps(self.names, self.contents.end(), open_end=open_end)


def survey(file: BufferedReader) -> Survey:
    """Read an open recording without keeping its samples.

    Raises:
        RecordingError: Too little of it is intact to know what it holds.
    """
    try:
        check_header(file)
    except RecordingError as error:  # what it advises instead is to survey the file
        return _survey(file, _intact(file), str(error).partition(";")[0])
    try:
        with verifying(file) as records:
            return _survey(file, records, None)
    except DamageError as error:
        return _survey(file, _intact(file), str(error))


def _intact(file: BufferedReader) -> Iterator[Record]:
    """Yield the intact records, the Metadata first: other programs write them anywhere."""
    yield from find_intact(file, Opcode.METADATA)
    yield from find_intact(file, Opcode.CHUNK)


def _survey(file: BufferedReader, records: Iterator[Record], damage: str | None) -> Survey:
    contents, runs = Contents(size_of(file)), Runs(size=None)
    for layout, block in contents.blocks(records):
        runs.add(layout, block)
    try:
        checked = not contents.unchecked or (damage is None and has_data_crc(file))
        return Survey(damage, contents, runs, contents.rig(), contents.session(), checked)
    except RecordingError as error:
        if damage is None:
            raise
        raise RecordingError(
            f"{damage}; the intact part does not say what was recorded: {error}"
        ) from error


def describe(path: str | Path) -> Description:
    """Describe a recording, even if it is damaged or has no samples.

    Raises:
        RecordingError: The file does not exist, is not from sautereau, or too little of it is
            intact.
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
        damage=damage and f"{damage}; recover the intact part with `sautereau recover {path}`",
        rig=found.rig.name,
        simulated=found.session.simulated,
        complete=not damage and not gaps and all(e.kind != "aborted" for e in contents.events),
        session=found.session.to_metadata(),
        rate=clock.rate if clock else None,
        first_sample=clock.begin if clock else 0,
        n_samples=n_samples,
        duration=n_samples / clock.rate if clock else 0.0,
        missing=[gap.document() for gap in gaps],
        channels=contents.channels,
        messages={topic: contents.counts[topic] for topic in contents.channels},
        events=[f"{event.time:.6f} s {event.kind}: {event.text}" for event in contents.events],
        software=contents.metadata["software"],
        t0_ns=clock.t0 if clock else None,
        t0_std=contents.t0_std,
        checked=found.checked,
        recovered=contents.metadata.get("recovered"),
        layout=str(LAYOUT),
    )
