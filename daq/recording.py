"""Write one press into one MCAP file, durable from the first chunk on."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer
from numpy.typing import ArrayLike

from daq.block import Block
from daq.durable import DurableFile
from daq.errors import RecordingError
from daq.preview import Decimator
from daq.provenance import write_head
from daq.schemas import encode
from daq.session_info import SessionInfo
from rig.schema import Rig

__all__ = ["Block", "Recording", "SessionInfo"]

CHUNK_SIZE = 256 * 1024
"""Bytes, uncompressed; a crash loses at most what the open chunk holds."""


class Recording:
    """An open recording; leave it to close the file, whole or not.

    The file is ``path.part`` until the context is left without an exception, then
    ``path``. After an exception the ``.part`` stays, well closed, with an event
    ``aborted`` that says why.
    """

    def __init__(
        self,
        path: str | Path,
        rig: Rig,
        *,
        session: SessionInfo,
        rate: float | None = None,
        clock: Callable[[], int] = time.time_ns,
    ):
        """Prepare; the file is opened on entering.

        Args:
            path: Of the finished file; it must not exist.
            rig: Whole bench, written into the file.
            session: What the press is; its `simulated` above all.
            rate: Hz, at which the device really samples; None for the rig's.
            clock: ns since 1970; gives the trigger's date as the first block arrives.
        """
        self._rig = rig
        self._session = session
        self._rate = rig.daq.sample_rate if rate is None else rate
        self._clock = clock
        self._path = Path(path)
        self._file: DurableFile | None = None
        self._writer: Writer | None = None
        self._topics: dict[str, int] = {}
        self._previews = [Decimator(self._rate) for _ in rig.daq.channels]
        self._n_samples = 0
        self._t0: int | None = None
        self._broken = False

    @property
    def part_path(self) -> Path:
        """Where the samples are until the recording has been closed without a fault."""
        return self._path.with_name(self._path.name + ".part")

    @property
    def t0_ns(self) -> int | None:
        """ns since 1970 of the trigger by the host's clock; None before the first block."""
        return self._t0

    @property
    def n_samples(self) -> int:
        """Samples of each channel written so far."""
        return self._n_samples

    def __enter__(self) -> "Recording":
        file = self._file = DurableFile(self._path)
        self._writer = Writer(
            file.stream,
            chunk_size=CHUNK_SIZE,
            compression=CompressionType.ZSTD,
            enable_data_crcs=True,
        )
        try:
            with file.writing():
                self._topics = write_head(self._writer, self._rig, self._session, self._rate)
                file.stream.flush()
        except BaseException as error:
            self._broken = True
            self.__exit__(type(error), error, None)
            raise
        return self

    def __exit__(self, _type: object, error: BaseException | None, _trace: object) -> None:
        file = self._file
        if file is None:
            return
        if error is None:
            self._finish(file)
            file.publish()
            return
        error.add_note(f"what was recorded before is in {self.part_path}")
        try:
            if not self._broken:
                self.event("aborted", f"{type(error).__name__}: {error}", self._elapsed())
            self._finish(file)
        except RecordingError as second:
            error.add_note(f"then the recording could not be closed well either: {second}")

    def write_block(self, block: Block) -> None:
        """Write consecutive samples of all channels, and their preview.

        Raises:
            RecordingError: The block does not follow the last one, has the wrong shape,
                or cannot be written.
        """
        first_sample = block.first_sample
        channels = self._rig.daq.channels
        volts = np.asarray(block.volts, dtype=np.float64)
        if volts.ndim != 2 or volts.shape[0] != len(channels) or volts.shape[1] == 0:
            raise RecordingError(
                f"recording {self._path}: a block of shape {volts.shape} at sample"
                f" {first_sample}; the rig has {len(channels)} channels: give (n_channels, n)"
            )
        if first_sample != self._n_samples:
            raise RecordingError(
                f"recording {self._path}: a block starts at sample {first_sample}, but the next"
                f" one is {self._n_samples}; samples were lost or given twice: press again"
            )
        n = volts.shape[1]
        last = first_sample + n - 1
        if self._t0 is None:
            self._t0 = self._clock() - self._nanoseconds(last)
        for channel, row, preview in zip(channels, volts, self._previews, strict=True):
            samples = encode(
                "Samples", t0=self._t0, first_sample=first_sample, rate=self._rate, volts=row
            )
            self._log(f"/daq/{channel.name}", self._t0 + self._nanoseconds(last), samples)
            for middle, mean in zip(*preview.feed(row), strict=True):
                scalar = encode("Scalar", value=mean * channel.scale)
                self._log(f"/preview/{channel.name}", self._t0 + self._nanoseconds(middle), scalar)
        self._n_samples += n

    def write_plan(self, t: ArrayLike, q1: ArrayLike, q2: ArrayLike, jack_rise: ArrayLike) -> None:
        """Write the planned motion: arrays of shape (n,); s from the trigger, rad, rad, m."""
        self._series("Plan", t=t, q1=q1, q2=q2, jack_rise=jack_rise)

    def write_joints(self, t: ArrayLike, q1: ArrayLike, q2: ArrayLike) -> None:
        """Write what the encoders captured: shape (n,); s on the controller's clock, rad, rad."""
        self._series("Joints", t=t, q1=q1, q2=q2)

    def event(self, kind: str, text: str, time_s: float) -> None:
        """Write what happened ``time_s`` (s) after the trigger; negative for before it."""
        log_time = self._clock() if self._t0 is None else self._t0 + round(time_s * 1e9)
        self._log("/events", log_time, encode("Event", time=time_s, kind=kind, text=text))

    def _series(self, message: str, **arrays: ArrayLike) -> None:
        columns = {name: np.asarray(column, dtype=float) for name, column in arrays.items()}
        shapes = {name: column.shape for name, column in columns.items()}
        if columns["t"].ndim != 1 or len(set(shapes.values())) != 1:
            listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
            raise RecordingError(
                f"recording {self._path}: /{message.lower()} has arrays of shapes {listed}; give"
                " them all the one shape (n,)"
            )
        log_time = self._clock() if self._t0 is None else self._t0
        self._log(f"/{message.lower()}", log_time, encode(message, **columns))

    def _log(self, topic: str, log_time: int, data: bytes) -> None:
        if self._writer is None or self._file is None or self._broken:
            raise RecordingError(
                f"recording {self._path}: it is not open; write inside `with Recording(...)`"
            )
        try:
            with self._file.writing():
                self._writer.add_message(
                    self._topics[topic], max(0, log_time), data, publish_time=max(0, log_time)
                )
        except RecordingError:
            self._broken = True
            raise

    def _finish(self, file: DurableFile) -> None:
        """Complete the MCAP file and put it on the disk, still as ``.part``."""
        writer, self._writer, self._file = self._writer, None, None
        if self._broken or writer is None:
            with file.writing():
                file.stream.close()
            raise RecordingError(
                f"recording {self._path}: an earlier fault has left it cut short, in"
                f" {self.part_path}; press again"
            )
        try:
            with file.writing():
                writer.finish()
        except RecordingError:
            with file.writing():
                file.stream.close()
            raise
        file.close()

    def _nanoseconds(self, sample: float) -> int:
        return round(sample * 1e9 / self._rate)

    def _elapsed(self) -> float:
        return 0.0 if self._t0 is None else (self._clock() - self._t0) / 1e9
