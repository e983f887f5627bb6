"""Read a recording: complete or not at all, or one stretch at a time in the memory of one."""

from collections.abc import Iterator
from math import ceil
from pathlib import Path

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.records import MAGIC, Opcode
from sautereau.daq.file.contents import Contents
from sautereau.daq.file.integrity import (
    Section,
    has_data_crc,
    head,
    indexed,
    opened,
    size_of,
    verified,
    verifying,
)
from sautereau.daq.file.limits import FARTHEST_SAMPLE, FARTHEST_TIME
from sautereau.daq.file.recorded import Recorded, SessionInfo, Stretch
from sautereau.daq.file.runs import Runs


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
        missing = "; ".join(map(str, part.gaps[:8]))
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
        contents, runs = Contents(size_of(file)), Runs(size=size_of(file), complete=True)
        with verifying(file) as all_records:
            for layout, block in contents.blocks(all_records):
                runs.add(layout, block)
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
                t0_std=contents.t0_std,
                checked=not contents.unchecked or has_data_crc(file),
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
        contents = Contents(size_of(file))
        for record in Section(file, len(MAGIC), size_of(file)).records():
            if record.opcode == Opcode.CHUNK:
                break
            list(contents.blocks([record]))
            if "session" in contents.metadata:
                break  # before the next record, which may be truncated
        if "session" not in contents.metadata:
            list(contents.blocks(head(file, size_of(file))[0]))
        return contents.session()


def _unequal(part: Recorded) -> bool:
    """Return whether anything is missing except an end that all channels lack alike."""
    stop = part.first_sample + part.n_samples
    ends = {gap.channel: gap.stop_sample for gap in part.gaps if gap.first_sample == stop}
    alike = len(set(ends.values())) == 1 and set(ends) == set(part.volts)
    return bool(part.gaps) and not (alike and len(ends) == len(part.gaps))


def stream(path: str | Path, seconds: float) -> Iterator[Stretch]:
    """Yield a recording of any length, ``seconds`` (s) of it at a time.

    The checksums of the complete file are verified before the first stretch. No stretch spans
    a gap; the last one before a gap or at the end is shorter.

    Raises:
        RecordingError: As `read_recording`, except for gaps.
    """
    if not 0 < seconds < float("inf"):
        raise RecordingError(
            f"recording {path}: stretches of {seconds:g} s are requested; request more than 0 s"
        )
    with opened(Path(path)) as file:
        size = size_of(file)
        contents, runs, names, n = Contents(size), Runs(size=size), list[str](), 1
        for layout, block in contents.blocks(verified(file)):
            runs.add(layout, block)  # which refuses a rate that is none
            if not names:
                names = [channel.name for channel in contents.rig().daq.channels]
                n = max(1, min(round(seconds * block.rate), FARTHEST_SAMPLE))
            while layout.names[-1] == names[-1] and (found := runs.take(names, n, ended=False)):
                yield found
        while found := runs.take(names, n, ended=True):
            yield found


def read_window(path: str | Path, start: float, stop: float) -> Stretch:
    """Read ``start <= t < stop`` (s after the trigger, negative before it) of a recording.

    Only the chunks of this window are read and verified.

    Raises:
        RecordingError: The window reaches beyond the recording or spans a gap, or as
            `read_recording`.
    """
    window = f"the window from {start:g} s to {stop:g} s"
    if not all(abs(time) <= FARTHEST_TIME for time in (start, stop)):  # NaN too
        raise RecordingError(
            f"recording {path}: {window}: give times within FARTHEST_TIME = {FARTHEST_TIME:g} s"
            " before and after the trigger"
        )
    with opened(Path(path)) as file:
        definitions, chunks = indexed(file)
        contents, runs = Contents(size_of(file)), Runs(size=size_of(file))
        list(contents.blocks(definitions))
        names = [channel.name for channel in contents.rig().daq.channels]
        chunks = contents.with_samples(chunks)
        first, last = 0, 0
        for chunk in chunks:
            clock = runs.clock
            if clock and chunk.last < max(0, clock.t0 + round(first * 1e9 / clock.rate)):
                continue
            for layout, block in contents.blocks(Section(file, chunk.start, chunk.stop).records()):
                runs.add(layout, block)
                first, last = (ceil(round(t * block.rate, 6)) for t in (start, stop))
            if runs.clock and (runs.reached(names) or first) >= last:
                break
        if runs.clock is None:
            raise RecordingError(f"{window}: the recording holds no samples: press again")
        if first >= last:
            raise RecordingError(f"{window}: it contains no sample; give a later stop")
        for held_first, held_stop in runs.common(names):
            if held_first <= first and last <= held_stop:
                volts = {name: runs.volts(name, first, last) for name in names}
                return Stretch(runs.clock.t0, runs.clock.rate, first, volts)
    raise RecordingError(
        f"recording {path}: {window}: samples are missing; `sautereau info {path}` shows which"
    )
