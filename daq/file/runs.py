"""Runs of consecutive samples of each channel, joined from blocks; gaps separate the runs."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.integrity import FOREIGN
from sautereau.daq.file.limits import MOST_VOLTS, VOLTS_PER_BYTE, time_faults
from sautereau.daq.file.recorded import Gap, Signal, Stretch
from sautereau.daq.file.samples import SampleLayout, WireBlock, write_volts
from sautereau.rig.faults import fault_list

MOST_RUNS = 10_000  # Limit for one channel


class Clock(NamedTuple):
    """What all blocks of a recording have in common."""

    t0: int
    """Date of the trigger, ns since 1970."""
    rate: float
    """Sampling rate, Hz."""
    begin: int
    """Index of the recording's first sample, counted from the trigger."""


class _Run:
    """Consecutive samples of some channels, in an array that has room for more."""

    def __init__(self, first: int, n_channels: int, room: int):
        self.first = self.stop = first
        self._room = np.empty((n_channels, room))

    def extend(self, n: int) -> Signal:
        """Return an array for the next ``n`` samples, shape (n_channels, n), to be filled."""
        held = self.stop - self.first
        if held + n > self._room.shape[1]:
            grown = np.empty((len(self._room), max(held + n, 2 * held)))
            grown[:, :held] = self._room[:, :held]
            self._room = grown
        self.stop += n
        return self._room[:, held : held + n]

    def volts(self, row: int, first: int, stop: int) -> Signal:
        return self._room[row, first - self.first : stop - self.first]

    def cut(self, stop: int) -> int:
        """Drop the samples before ``stop``, and return their number."""
        n = min(max(stop - self.first, 0), self.stop - self.first)
        left = self.stop - self.first - n
        self._room[:, :left] = self._room[:, n : n + left].copy()
        self.first += n
        return n


class Runs:
    """The samples of a recording, added block by block."""

    def __init__(self, *, size: int | None, complete: bool = False):
        """Start empty.

        Args:
            size: Size of the file in bytes, which limits the samples held at once; None to keep no
                samples, only their indices.
            complete: Whether the samples of the complete file will be held.
        """
        self._size, self._complete = size, complete
        self._left = 0 if size is None else max(MOST_VOLTS, VOLTS_PER_BYTE * size)
        self._groups: dict[tuple[str, ...], list[_Run]] = {}
        self._rows: dict[str, tuple[list[_Run], int]] = {}
        self.clock: Clock | None = None
        """None before the first block."""

    def add(self, layout: SampleLayout, block: WireBlock) -> None:
        """Add a block.

        Raises:
            RecordingError: It has no samples, repeats some, or contradicts the blocks before.
        """
        clock = Clock(block.t0, block.rate, block.begin)
        n, rest = divmod(len(block.data), layout.size)
        first, names = block.first_sample, ", ".join(layout.names)
        if faults := time_faults(clock.t0, clock.rate, clock.begin, first + n):
            raise RecordingError(f"{fault_list(f'a block of {names}', faults)}; {FOREIGN}")
        if self.clock not in (None, clock):
            raise RecordingError(f"its blocks have different triggers or rates; {FOREIGN}")
        if rest or not n or first < clock.begin:
            raise RecordingError(
                f"a block of {names} at sample {first} has {len(block.data)} bytes of samples in a"
                f" recording that starts at sample {clock.begin}; {FOREIGN}"
            )
        self.clock = clock
        run = self._run(layout, names, first, n)
        if self._size is None:
            run.stop += n
        else:
            self._limit(n * len(layout.names))
            write_volts(layout.columns(block.data), layout.scaling, run.extend(n))

    def _limit(self, volts: int) -> None:
        """Refuse volts that exceed the limit of memory for the file."""
        self._left -= volts * np.dtype(float).itemsize
        if self._left < 0:
            raise RecordingError(
                f"its volts exceed the limits MOST_VOLTS = {MOST_VOLTS} bytes and VOLTS_PER_BYTE ="
                f" {VOLTS_PER_BYTE} for each byte of the file: read it in shorter stretches, with"
                " sautereau.daq.file.reading.stream"
            )

    def _run(self, layout: SampleLayout, names: str, first: int, n: int) -> _Run:
        """Return the run that ``n`` samples from index ``first`` extend, or a new one."""
        runs = self._groups.setdefault(layout.names, [])
        if not runs:
            if again := [name for name in layout.names if name in self._rows]:
                raise RecordingError(f"it has {', '.join(again)} in several topics; {FOREIGN}")
            self._rows |= {name: (runs, row) for row, name in enumerate(layout.names)}
        if not runs or first > runs[-1].stop:
            if len(runs) == MOST_RUNS:
                raise RecordingError(f"{names} has more than the limit of {MOST_RUNS} gaps")
            room = 0
            if self._size and self._complete and not runs:
                # More than a press has, whose compressed file has half the size of its volts.
                room = max(100_000 // len(layout.names), self._size // layout.size)
            runs.append(_Run(first, len(layout.names), room))
        if first < runs[-1].stop:
            raise RecordingError(
                f"samples {first} to {min(first + n, runs[-1].stop) - 1} of {names} are repeated,"
                f" or follow later ones; {FOREIGN}, or order it with `mcap sort`"
            )
        return runs[-1]

    def _of(self, name: str) -> list[_Run]:
        return self._rows[name][0] if name in self._rows else []

    def common(self, names: Iterable[str]) -> list[tuple[int, int]]:
        """Return the stretches (first, stop) in which every channel has samples."""
        found: list[tuple[int, int]] | None = None
        for name in names:
            runs = [(run.first, run.stop) for run in self._of(name)]
            found = runs if found is None else _overlap(found, runs)
        return found or []

    def count(self, name: str) -> int:
        """Return the number of samples of a channel."""
        return sum(run.stop - run.first for run in self._of(name))

    def last(self) -> int:
        """Return the index after the last sample of any channel; at least one must exist."""
        return max(runs[-1].stop for runs in self._groups.values())

    def reached(self, names: Iterable[str]) -> int | None:
        """Return the index up to which every channel has samples; None if one has none."""
        if self.clock is None or any(name not in self._rows for name in names):
            return None
        return min(self._of(name)[-1].stop for name in names)

    def volts(self, name: str, first: int, stop: int) -> Signal:
        """Return samples of one channel within one run, V, without copying them."""
        runs, row = self._rows[name]
        run = next(run for run in runs if run.first <= first and stop <= run.stop)
        return run.volts(row, first, stop)

    def take(self, names: Sequence[str], n: int, *, ended: bool) -> Stretch | None:
        """Remove and return the first ``n`` samples of all channels.

        Returns:
            Fewer than ``n`` before a gap, and at the end if ``ended``; None if there are not
            enough yet.
        """
        common = self.common(names)
        if self.clock is None or not common:
            return None
        first, stop = common[0]
        runs = [next(r for r in self._of(name) if r.stop > first) for name in names]
        closed = ended or any(
            run.stop == stop and run is not self._of(name)[-1]
            for name, run in zip(names, runs, strict=True)
        )
        if stop - first < n and not closed:
            return None
        stop = min(stop, first + n)
        volts = {name: self.volts(name, first, stop).copy() for name in names}
        for group, held in self._groups.items():
            for run in held:
                self._limit(-run.cut(stop) * len(group))
            held[:-1] = [run for run in held[:-1] if run.first < run.stop]
        return Stretch(self.clock.t0, self.clock.rate, first, volts)

    def gaps(self, names: Iterable[str], end: int | None, *, open_end: bool) -> tuple[Gap, ...]:
        """Return the missing samples.

        Args:
            names: Names of all channels.
            end: Index after the recording's last sample; None if it is unknown.
            open_end: Whether samples are missing at an unknown end.
        """
        clock, names = self.clock, tuple(names)
        if clock is None:
            return ()
        held = {name: [(r.first, r.stop) for r in self._of(name)] for name in names}
        last = max((runs[-1][1] for runs in held.values() if runs), default=clock.begin)
        last = last if end is None else max(last, end)
        gaps = []
        for name, runs in held.items():
            at = clock.begin
            for first, stop in [*runs, (last, last)]:
                if first > at:
                    gaps.append(Gap(name, at, first, clock.rate))
                at = max(at, stop)
            if end is None and open_end:
                gaps.append(Gap(name, last, None, clock.rate))
        return tuple(gaps)


def _overlap(a: list[tuple[int, int]], b: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return the intersection of two ascending lists of stretches."""
    found, i, j = [], 0, 0
    while i < len(a) and j < len(b):
        first, stop = max(a[i][0], b[j][0]), min(a[i][1], b[j][1])
        if first < stop:
            found.append((first, stop))
        if a[i][1] <= b[j][1]:
            i += 1
        else:
            j += 1
    return found
