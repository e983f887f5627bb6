"""Read a recording back, whole or not at all."""

from pathlib import Path

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.contents import Contents
from sautereau.daq.file.integrity import opened, size_of, verified
from sautereau.daq.file.recorded import Event, Gap, Joints, Plan, Recorded
from sautereau.daq.file.runs import Runs

__all__ = ["Event", "Gap", "Joints", "Plan", "Recorded", "read_parts", "read_recording"]

MOST_TOLD = 8
"""Gaps that one message names."""


def read_recording(path: str | Path) -> Recorded:
    """Read one press.

    Returns:
        Raw volts bit for bit, with everything that was recorded beside them.

    Raises:
        DamageError: The file is cut short or changed by a single byte.
        RecordingError: It is missing, not ours, holds no samples, or lacks a stretch
            between some.
    """
    part, *more = read_parts(path)
    if more or _unequal(part):
        missing = "; ".join(map(str, part.gaps[:MOST_TOLD]))
        raise RecordingError(
            f"recording {path}: {missing}; a hole is never filled: press again, or"
            " take the parts on either side by daq.file.reading.read_parts"
        )
    return part


def read_parts(path: str | Path) -> tuple[Recorded, ...]:
    """Read a recording that has lost samples, each stretch between two gaps for itself.

    Returns:
        Stretches in which every channel has its samples, in the order of time; each tells
        all gaps of the file.

    Raises:
        RecordingError: As `read_recording`, but for gaps.
    """
    path = Path(path)
    with opened(path) as file:
        contents, runs = Contents(size_of(file)), Runs()
        for topic, block in contents.messages(verified(file)):
            runs.add(topic, block)
        rig, session = contents.rig(), contents.session()
        names = [channel.name for channel in rig.daq.channels]
        clock, common = runs.clock, runs.common(names)
        if clock is None or not common:
            raise RecordingError(
                "it holds no samples"
                + (
                    ": the press ended before the trigger came; its events say why: press again"
                    if clock is None
                    else " that all its channels share: press again"
                )
            )
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


def _unequal(part: Recorded) -> bool:
    """Return whether anything but the end, of all channels alike, is missing."""
    stop = part.first_sample + part.n_samples
    ends = {gap.channel: gap.stop_sample for gap in part.gaps if gap.first_sample == stop}
    alike = len(set(ends.values())) == 1 and set(ends) == set(part.volts)
    return bool(part.gaps) and not (alike and len(ends) == len(part.gaps))
