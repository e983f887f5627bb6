"""Write one press into one MCAP file, durable from the first chunk on."""

import math
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.durable import FLUSH_PERIOD, PART, RecordingFile
from sautereau.daq.file.limits import MOST_EVENTS, event_faults, series_faults, time_faults
from sautereau.daq.file.log_order import LogOrder
from sautereau.daq.file.provenance import head_of, start_head
from sautereau.daq.file.recorded import (
    Block,
    Event,
    Joints,
    Plan,
    SessionInfo,
    Signal,
)
from sautereau.daq.file.samples import Scaling, sample_layout
from sautereau.daq.file.trigger_date import Counted, TriggerDate
from sautereau.rig.disk import as_text
from sautereau.rig.faults import fault_list
from sautereau.rig.schema import Rig

__all__ = ["Block", "Recording", "SessionInfo"]

ABORTED = "aborted"  # Kind of the last event of a recording that an exception has ended


class Recording:
    """An open recording, to use as a context manager.

    The file is called ``path.part`` until the context is left without an exception, then
    ``path``. After an exception the ``.part`` file is kept, properly closed, with an event
    ``aborted`` that gives the reason.
    """

    def __init__(
        self,
        path: str | Path,
        rig: Rig,
        *,
        session: SessionInfo,
        rate: float | None = None,
        scaling: Scaling | None = None,
        t0_ns: int | None = None,
        t0_std: float | None = None,
        compress: bool | None = None,
        clock: Callable[[], int] = time.time_ns,
        monotonic: Callable[[], float] = time.perf_counter,
        ending: str = PART,
    ):
        """Prepare; the file is opened on entering the context.

        Args:
            path: Finished file; it must not exist.
            rate: Actual sampling rate of the device, Hz; None for the rig's.
            scaling: Scaling of the device's counts; None for a recording of volts.
            t0_ns: Date of the trigger, ns since 1970; None to find it from the first blocks.
            t0_std: Standard uncertainty of a date that is given, s; None if it is unknown.
            compress: Whether to compress chunks with zstd; None to compress volts only, since the
                noise of a converter leaves little to compress in its counts.
            clock: ns since 1970; read once, here. All dates in the file follow from it and from
                `monotonic`, so that later changes of the host's clock have no effect.
            monotonic: Time in s of a clock that is never set. `Counted` in the blocks uses the same
                clock. It also determines when to flush.
            ending: Appended to the name of the unfinished file; see `DurableFile`.

        Raises:
            RecordingError: No reader would accept its metadata, rate or date.
        """
        self._path = Path(path)
        self._rate = rig.daq.sample_rate if rate is None else rate
        self._refuse_faults(time_faults(t0_ns or 0, self._rate))
        self._layout = sample_layout((channel.name for channel in rig.daq.channels), scaling)
        self._head = head_of(rig, session, self._rate, self._layout)
        self._compress = scaling is None if compress is None else compress
        self._ending = ending
        self._zero_ns = clock() - round(monotonic() * 1e9)
        self._opened: RecordingFile | None = None
        self._order = LogOrder(rig, self._rate, self._layout)
        self._given = None if t0_ns is None else (t0_ns, t0_std)
        self._monotonic, self._trigger = monotonic, TriggerDate(self._rate)
        self._first: int | None = None
        self._next = 0
        self._held = self._layout.empty(0)
        self._fill = self._events = 0

    @property
    def part_path(self) -> Path:
        """File that holds the samples until the recording has been closed without a fault."""
        return self._path.with_name(self._path.name + self._ending)

    @property
    def _removed(self) -> str:
        return f"{self.part_path} was removed, with the samples recorded before"

    @property
    def t0_ns(self) -> int | None:
        """Date of the trigger by the host's clock, ns since 1970; None before the first block.

        Later blocks may correct it until the first block is in the file.
        """
        if self._first is None or self._order.t0 is not None:
            return self._order.t0
        return self._dated()[0]

    @property
    def n_samples(self) -> int:
        """Number of samples of each channel written so far."""
        return 0 if self._first is None else self._next - self._first

    def __enter__(self) -> "Recording":
        file = self._opened = RecordingFile(
            self._path, compress=self._compress, seconds=self._monotonic, ending=self._ending
        )
        try:
            with file.flushing() as writer:
                start_head(writer, self._head.metadata)
                self._order.topics = self._head.topics
        except BaseException as error:
            self.__exit__(type(error), error, None)
            raise
        size = min(round(FLUSH_PERIOD * self._rate), 2**23 // self._layout.size)  # At most 8 MiB
        self._held = self._layout.empty(max(1, size))
        return self

    def __exit__(self, _type: object, error: BaseException | None, _trace: object) -> None:
        file = self._opened
        if file is None:
            return
        if error is None:
            try:
                self._close(file)
                file.publish()
            except BaseException as fault:
                file.abandon()
                if file.kept and not self._path.exists():
                    there = f"the samples are in {self.part_path}, for `sautereau recover`"
                    fault.add_note(there if self.part_path.exists() else self._removed)
                raise
            return
        if not file.kept:
            self._opened = None
            file.abandon()
            return
        if not self.part_path.exists():
            error.add_note(self._removed)
        elif self._first is None:
            error.add_note(f"no sample was recorded; delete {self.part_path}")
        else:
            error.add_note(f"the samples recorded before are in {self.part_path}")
        try:
            if not file.broken:
                t0 = self.t0_ns
                elapsed = 0.0 if t0 is None else (self._now_ns() - t0) / 1e9
                self.event(ABORTED, f"{type(error).__name__}: {error}", elapsed)
                self._close(file)
        except RecordingError as second:
            error.add_note(f"then closing the recording failed as well: {second}")
        finally:
            self._opened = None
            file.abandon()

    def write_block(self, block: Block) -> None:
        """Write consecutive samples of all channels, and their preview.

        The first block determines where the recording starts: at the trigger, or before it.

        Raises:
            RecordingError: The block does not follow the last one, has the wrong shape or type, or
                cannot be written; or the device gave a number that is not finite: what precedes it
                is written.
        """
        self._file()
        self._refuse(block)
        fault = ""
        if self._given is None:  # otherwise they are of a file, which may hold any doubles
            block, fault = block.finite(self._layout.names)
        if block.n_samples:
            self._hold(block)
        if fault:
            raise RecordingError(
                f"recording {self._path}: the device failed: {fault}: check device and driver, and"
                " press again"
            )

    def _hold(self, block: Block) -> None:
        """Add a block to the held samples, and write those that are due."""
        file, samples = self._file(), block.samples
        if self._first is None:
            self._first = self._next = block.first_sample
        if self._order.t0 is None:
            # The counts of the block and its arrival narrow down the time of the trigger.
            end = block.first_sample + block.n_samples
            for counted in (*block.counted, Counted(-math.inf, self._monotonic(), end)):
                self._trigger.add(counted)
        at, size, room = 0, samples.shape[1], self._held.shape[1]
        while at < size:
            n = min(size - at, room - self._fill)
            self._held[:, self._fill : self._fill + n] = samples[:, at : at + n]
            at, self._fill, self._next = at + n, self._fill + n, self._next + n
            if self._fill == room:
                self._write_held(file)
        if self._fill > self._order.margin and file.flush_due:
            self._write_held(file)
        file.sync_if_due()

    def before_trigger(self) -> None:
        """State that the trigger is still to come: no date of it is before this call.

        Call it before the command that causes the trigger, or that starts the device.
        """
        self._trigger.not_before(self._monotonic())

    def write_plan(self, t: ArrayLike, q1: ArrayLike, q2: ArrayLike, jack_rise: ArrayLike) -> None:
        """Write the planned motion: arrays of shape (n,); s after the trigger, rad, rad, m."""
        self._series("Plan", t=t, q1=q1, q2=q2, jack_rise=jack_rise)

    def write_joints(self, joints: Joints) -> None:
        """Write what the controller captured on its own clock."""
        self._series(
            "Joints", **{name: column for name, column in vars(joints).items() if len(column)}
        )

    def write_scenes(
        self, times: Signal, lines: Mapping[str, Signal], frames: Mapping[str, Signal]
    ) -> None:
        """Write drawings for a viewer: lines in space and the links of a URDF, at some times.

        The balance pin is the origin, x points to the jack, z up.

        Args:
            times: s after the trigger, shape (n,).
            lines: Points of each line by name, m, shape (n, n_points, 3).
            frames: x and z, m, and angle, rad, of each link's frame by name, shape (n, 3).
        """
        self._file()
        self._order.add_scenes(self._now_ns(), times, lines, frames)

    def event(self, kind: str, text: str, time_s: float, std: float = 0.0) -> None:
        """Write an event at ``time_s`` (s after the trigger, negative before it), +-``std``.

        It is written with the samples of that time, or at the next `flush`. Bytes in the text that
        are not UTF-8, as in the name of a file, are written as escapes.
        """
        event = Event(time_s, as_text(kind), as_text(text), std)
        self._events += 1
        if self._events >= MOST_EVENTS and kind != ABORTED:
            self._refuse_faults([f"events: more than MOST_EVENTS = {MOST_EVENTS}"])
        self._refuse_faults(event_faults([event]))
        self._file()
        self._order.add_event(self._now_ns(), event)

    def flush(self) -> None:
        """Write everything so far, as at the end of the samples."""
        file = self._file()
        if self._fill:
            self._write_held(file)
        with file.flushing() as writer:
            self._order.write_views(writer)

    def _refuse(self, block: Block) -> None:
        """Refuse a block that does not fit, or does not follow the last one."""
        samples, first = block.samples, block.first_sample
        shape, kind = samples.shape, self._layout.kind
        if len(shape) != 2 or shape[0] != len(self._layout.names) or shape[1] == 0:
            raise RecordingError(
                f"recording {self._path}: a block of shape {shape} at sample {first}; the"
                f" rig has {len(self._layout.names)} channels: give (n_channels, n)"
            )
        if samples.dtype != self._held.dtype:
            raise RecordingError(
                f"recording {self._path}: a block of {samples.dtype} samples at sample {first}; it"
                f" was opened for {kind}: give those, or open it with the `scaling` of the counts"
            )
        if first != self._next and (self._first is not None or first > 0):
            raise RecordingError(
                f"recording {self._path}: a block starts at sample {first}, but the next sample is"
                f" {self._next}; samples were lost or written twice: press again"
            )
        t0 = self._order.t0
        self._refuse_faults(time_faults(t0 or 0, self._rate, first, first + shape[1]))

    def _dated(self) -> tuple[int, float | None]:
        """Return the date of the trigger, ns since 1970, and its standard uncertainty, s."""
        if self._given is not None:
            return self._given
        time_s, std = self._trigger.found()
        return self._zero_ns + round(time_s * 1e9), std

    def _write_held(self, file: RecordingFile) -> None:
        """Write the held samples as one block, in a chunk of its own."""
        samples, first = self._held[:, : self._fill], self._next - self._fill
        if self._order.t0 is None:
            self._order.start(self._dated()[0], first)
        self._fill = 0
        with file.flushing() as writer:
            self._order.write_block(writer, first, samples)

    def _refuse_faults(self, faults: list[str]) -> None:
        """Refuse what no reader would accept."""
        if faults:
            raise RecordingError(fault_list(f"recording {self._path}", faults))

    def _series(self, message: str, **arrays: ArrayLike) -> None:
        columns = {name: np.asarray(column, dtype=float) for name, column in arrays.items()}
        shapes = {name: column.shape for name, column in columns.items()}
        if columns["t"].ndim != 1 or len(set(shapes.values())) != 1:
            listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
            raise RecordingError(
                f"recording {self._path}: /{message.lower()} has arrays of the shapes {listed};"
                " give all of them the same shape (n,)"
            )
        if not all(np.isfinite(column).all() for column in columns.values()):
            raise RecordingError(
                f"recording {self._path}: /{message.lower()} has numbers that are not finite; look"
                " at what the controller answered, and press again"
            )
        series = (Plan if message == "Plan" else Joints)(**columns)
        self._refuse_faults(series_faults(message.lower(), series))
        self._file()
        self._order.add_series(self._now_ns(), message, columns)

    def _now_ns(self) -> int:
        """Return the date, ns since 1970, unaffected by changes of the host's clock."""
        return self._zero_ns + round(self._monotonic() * 1e9)

    def _file(self) -> RecordingFile:
        if self._opened is None:
            raise RecordingError(
                f"recording {self._path}: not open; write inside `with Recording(...)`"
            )
        return self._opened

    def _close(self, file: RecordingFile) -> None:
        try:
            self.flush()
        finally:
            self._opened = None
        std = None if self._first is None else self._dated()[1]
        dated = {} if std is None else {"t0_std": repr(std)}
        file.finish({"stop_sample": str(self._next)} | dated)
