"""Read a recording of any length one stretch at a time, in the memory of one stretch."""

from collections.abc import Iterator
from math import ceil
from pathlib import Path

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.records import MAGIC
from sautereau.daq.file.contents import Contents
from sautereau.daq.file.integrity import chunk_index, opened, records, size_of, verified
from sautereau.daq.file.recorded import Stretch
from sautereau.daq.file.runs import Clock, Runs


def stream(path: str | Path, seconds: float) -> Iterator[Stretch]:
    """Yield a recording of any length, ``seconds`` (s) of it at a time.

    The checksums of the complete file are verified before the first stretch. No stretch spans
    a gap; the last one before a gap or at the end is shorter.

    Raises:
        RecordingError: As `sautereau.daq.file.reading.read_recording`, except for gaps.
    """
    if not 0 < seconds < float("inf"):
        raise RecordingError(
            f"recording {path}: stretches of {seconds:g} s are requested; request more than 0 s"
        )
    with opened(Path(path)) as file:
        contents, runs, names, n = Contents(size_of(file)), Runs(), list[str](), 1
        for topic, block in contents.messages(verified(file)):
            if not names:
                names = [channel.name for channel in contents.rig().daq.channels]
                n = max(1, round(seconds * block.rate))
            runs.add(topic, block)
            while topic == f"/daq/{names[-1]}" and (found := runs.take(names, n, ended=False)):
                yield found
        while found := runs.take(names, n, ended=True):
            yield found


def read_window(path: str | Path, start: float, stop: float) -> Stretch:
    """Read ``start <= t < stop`` (s after the trigger, negative before it) of a recording.

    Only the chunks of this window are read and verified.

    Raises:
        RecordingError: The window reaches beyond the recording or spans a gap, or as
            `sautereau.daq.file.reading.read_recording`.
    """
    window = f"the window from {start:g} s to {stop:g} s"
    with opened(Path(path)) as file:
        chunks = chunk_index(file)
        contents, runs = Contents(size_of(file)), Runs()
        if chunks:
            list(contents.messages(records(file, len(MAGIC), chunks[0].start)))
        names = [channel.name for channel in contents.rig().daq.channels]
        first, last = 0, 0
        for chunk in chunks:
            if runs.clock and chunk.last < _log_time(runs.clock, first):
                continue
            for topic, block in contents.messages(records(file, chunk.start, chunk.stop)):
                runs.add(topic, block)
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


def _log_time(clock: Clock, sample: int) -> int:
    return max(0, clock.t0 + round(sample * 1e9 / clock.rate))
