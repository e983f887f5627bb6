"""Write one press into one MCAP file, durable from the first chunk on."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.durable import PART, RecordingFile, SteadyClock
from sautereau.daq.file.container.records import CHUNK_SIZE
from sautereau.daq.file.container.writer import McapWriter
from sautereau.daq.file.preview import Decimator
from sautereau.daq.file.provenance import write_head
from sautereau.daq.file.recorded import Block, Joints, SessionInfo
from sautereau.daq.file.schemas import encode, encode_scalars
from sautereau.rig.schema import Rig

__all__ = ["Block", "Recording", "SessionInfo"]


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
        compress: bool = True,
        clock: Callable[[], int] = time.time_ns,
        monotonic: Callable[[], float] = time.monotonic,
        ending: str = PART,
    ):
        """Prepare; the file is opened on entering the context.

        Args:
            path: Finished file; it must not exist.
            rig: Complete rig, written into the file.
            session: Description of the press.
            rate: Actual sampling rate of the device, Hz; None for the rig's.
            compress: Whether to compress chunks with zstd; False for a host that is too slow.
            clock: ns since 1970; read once, here. Every date in the file follows from it and
                from `monotonic`, so that setting the clock meanwhile changes nothing.
            monotonic: Time in s of a clock that is never set; also determines when to flush.
            ending: Appended to the name of the unfinished file. With another one than `PART` it
                is made from other files, and what a killed program left of it is replaced.
        """
        self._path = Path(path)
        self._rig = rig
        self._session = session
        self._rate = rig.daq.sample_rate if rate is None else rate
        self._compress = compress
        self._ending = ending
        self._clock = SteadyClock(clock, monotonic)
        self._opened: RecordingFile | None = None
        self._topics: dict[str, int] = {}
        channels = rig.daq.channels
        self._scales = np.array([[channel.scale] for channel in channels])
        self._preview = Decimator(self._rate, len(channels))
        self._piece = max(1, CHUNK_SIZE // (8 * len(channels)))
        self._first: int | None = None
        self._next = 0
        self._t0 = 0

    @property
    def part_path(self) -> Path:
        """File that holds the samples until the recording has been closed without a fault."""
        return self._path.with_name(self._path.name + self._ending)

    @property
    def t0_ns(self) -> int | None:
        """Date of the trigger by the host's clock, ns since 1970; None before the first block."""
        return None if self._first is None else self._t0

    @property
    def n_samples(self) -> int:
        """Number of samples of each channel written so far."""
        return 0 if self._first is None else self._next - self._first

    def __enter__(self) -> "Recording":
        file = self._opened = RecordingFile(
            self._path,
            compress=self._compress,
            rate=self._rate,
            seconds=self._clock.seconds,
            ending=self._ending,
        )
        try:
            with file.writing() as writer:
                self._topics = write_head(writer, self._rig, self._session, self._rate)
            file.flush()
        except BaseException as error:
            self.__exit__(type(error), error, None)
            raise
        return self

    def __exit__(self, _type: object, error: BaseException | None, _trace: object) -> None:
        file = self._opened
        if file is None:
            return
        if error is None:
            self._close(file)
            file.publish()
            return
        error.add_note(f"the samples recorded before are in {self.part_path}")
        try:
            if not file.broken:
                elapsed = 0.0 if self._first is None else (self._clock.now_ns() - self._t0) / 1e9
                self.event("aborted", f"{type(error).__name__}: {error}", elapsed)
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
            RecordingError: The block does not follow the last one, has the wrong shape,
                or cannot be written.
        """
        file = self._file()
        channels = self._rig.daq.channels
        volts = np.asarray(block.volts, dtype=np.float64)
        first = block.first_sample
        if volts.ndim != 2 or volts.shape[0] != len(channels) or volts.shape[1] == 0:
            raise RecordingError(
                f"recording {self._path}: a block of shape {volts.shape} at sample {first}; the"
                f" rig has {len(channels)} channels: give (n_channels, n)"
            )
        if first != self._next and (self._first is not None or first > 0):
            raise RecordingError(
                f"recording {self._path}: a block starts at sample {first}, but the next sample is"
                f" {self._next}; samples were lost or written twice: press again"
            )
        if self._first is None:
            self._first = first
            acquired = first + volts.shape[1] if block.acquired is None else block.acquired
            self._t0 = self._clock.now_ns() - self._nanoseconds(acquired - 1)
        with file.writing() as writer:
            for start in range(0, volts.shape[1], self._piece):
                self._write_piece(writer, first + start, volts[:, start : start + self._piece])
                writer.close_chunk()
        self._next = first + volts.shape[1]
        file.keep(volts.shape[1])

    def write_plan(self, t: ArrayLike, q1: ArrayLike, q2: ArrayLike, jack_rise: ArrayLike) -> None:
        """Write the planned motion: arrays of shape (n,); s after the trigger, rad, rad, m."""
        self._series("Plan", t=t, q1=q1, q2=q2, jack_rise=jack_rise)

    def write_joints(self, joints: Joints) -> None:
        """Write what the controller captured on its own clock."""
        self._series(
            "Joints", **{name: column for name, column in vars(joints).items() if len(column)}
        )

    def event(self, kind: str, text: str, time_s: float, std: float = 0.0) -> None:
        """Write an event at ``time_s`` (s after the trigger, negative before it), +-``std``.

        Everything written so far is flushed with it immediately.
        """
        file = self._file()
        log_time = self._clock.now_ns() if self._first is None else self._t0 + round(time_s * 1e9)
        with file.writing() as writer:
            self._log(
                writer,
                "/events",
                log_time,
                encode("Event", time=time_s, kind=kind, text=text, std=std),
            )
        file.flush()

    def _write_piece(self, writer: McapWriter, first: int, volts: NDArray[np.float64]) -> None:
        """Write samples of all channels, few enough for one chunk."""
        last = self._t0 + self._nanoseconds(first + volts.shape[1] - 1)
        for channel, row in zip(self._rig.daq.channels, volts, strict=True):
            samples = encode(
                "Samples",
                t0=self._t0,
                first_sample=first,
                rate=self._rate,
                volts=row,
                begin=self._first,
            )
            self._log(writer, f"/daq/{channel.name}", last, samples)
        self._write_previews(writer, *self._preview.feed(volts))

    def _write_previews(
        self, writer: McapWriter, positions: NDArray[np.float64], values: NDArray[np.float64]
    ) -> None:
        if not len(positions):
            return
        since_trigger = (positions + (self._first or 0)) * (1e9 / self._rate)
        times = np.maximum(0, self._t0 + np.rint(since_trigger).astype(np.int64))
        for channel, row in zip(self._rig.daq.channels, values * self._scales, strict=True):
            writer.add_run(self._topics[f"/preview/{channel.name}"], times, encode_scalars(row))

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
        log_time = self._clock.now_ns() if self._first is None else self._t0
        with self._file().writing() as writer:
            self._log(writer, f"/{message.lower()}", log_time, encode(message, **columns))

    def _log(self, writer: McapWriter, topic: str, log_time: int, data: bytes) -> None:
        # MCAP's times start in 1970; earlier dates of a wrong host clock remain in `t0`.
        writer.add_message(self._topics[topic], max(0, log_time), data)

    def _file(self) -> RecordingFile:
        if self._opened is None:
            raise RecordingError(
                f"recording {self._path}: not open; write inside `with Recording(...)`"
            )
        return self._opened

    def _close(self, file: RecordingFile) -> None:
        self._opened = None
        with file.writing() as writer:
            self._write_previews(writer, *self._preview.rest())
        file.finish(self._next)

    def _nanoseconds(self, sample: float) -> int:
        return round(sample * 1e9 / self._rate)
