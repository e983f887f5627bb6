"""Read a recording, complete or not at all."""

from pathlib import Path

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.records import MAGIC, Opcode, read_metadata
from sautereau.daq.file.contents import Contents
from sautereau.daq.file.integrity import opened, records, size_of, verified
from sautereau.daq.file.recorded import Event, Gap, Joints, Plan, Recorded
from sautereau.daq.file.runs import Runs
from sautereau.daq.file.session_info import SessionInfo, session_from_metadata

__all__ = [
    "Event",
    "Gap",
    "Joints",
    "Plan",
    "Recorded",
    "read_parts",
    "read_recording",
    "read_session",
]

MOST_LISTED = 8
"""Gaps listed in one message."""


def read_recording(path: str | Path) -> Recorded:
    """Read one press.

    Returns:
        Raw volts bit for bit, with everything that was recorded besides them.

    Raises:
        DamageError: The file is truncated, or any byte has changed.
        RecordingError: It does not exist, is not from sautereau, holds no samples, or samples
            are missing between others.
    """
    part, *more = read_parts(path)
    if more or _unequal(part):
        missing = "; ".join(map(str, part.gaps[:MOST_LISTED]))
        raise RecordingError(
            f"recording {path}: {missing}; gaps are never filled: press again, or read the parts"
            " between the gaps with sautereau.daq.file.reading.read_parts"
        )
    return part


def read_parts(path: str | Path) -> tuple[Recorded, ...]:
    """Read a recording with missing samples, each part between two gaps separately.

    Returns:
        The stretches in which every channel has samples, in order of time; each lists all gaps
        of the file.

    Raises:
        RecordingError: As `read_recording`, except for gaps.
    """
    path = Path(path)
    with opened(path) as file:
        contents, runs = Contents(size_of(file)), Runs()
        for topic, block in contents.messages(verified(file)):
            runs.add(topic, block)
        rig, session = contents.rig(), contents.session()
        names = [channel.name for channel in rig.daq.channels]
        clock, common = runs.clock, runs.common(names)
        if clock is None:
            raise RecordingError(
                "it holds no samples: the press ended before the trigger; its events say why:"
                " press again"
            )
        if not common:
            raise RecordingError("it holds no samples that all its channels share: press again")
        gaps = runs.gaps(names, contents.end(), open_end=contents.recovered)
        return tuple(
            Recorded(
                t0_ns=clock.t0,
                rate=clock.rate,
                first_sample=first,
                volts={name: runs.volts(name, first, stop) for name in names},
                path=path,
                rig=rig,
                session=session,
                plan=contents.plan,
                joints=contents.joints,
                events=tuple(contents.events),
                software=contents.metadata["software"],
                channels=contents.channels,
                gaps=gaps,
            )
            for first, stop in common
        )


def read_session(path: str | Path) -> SessionInfo:
    """Read the description of the press from the start of a recording, and none of its samples.

    This does not verify the rest of the file; `read_recording` does.

    Raises:
        RecordingError: The file does not exist, is not from sautereau, or its start is damaged.
    """
    with opened(Path(path)) as file:
        for opcode, body in records(file, len(MAGIC), size_of(file)):
            if opcode == Opcode.CHUNK:
                break
            if opcode == Opcode.METADATA and (record := read_metadata(body)).name == "session":
                return session_from_metadata(record.metadata)
        raise RecordingError("it lacks the metadata session; give a recording of a press")


def _unequal(part: Recorded) -> bool:
    """Return whether anything is missing except an end that all channels lack alike."""
    stop = part.first_sample + part.n_samples
    ends = {gap.channel: gap.stop_sample for gap in part.gaps if gap.first_sample == stop}
    alike = len(set(ends.values())) == 1 and set(ends) == set(part.volts)
    return bool(part.gaps) and not (alike and len(ends) == len(part.gaps))
