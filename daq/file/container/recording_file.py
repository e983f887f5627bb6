"""The file under an open recording: what is handed to the system and to the disk, and when."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.durable import DurableFile
from sautereau.daq.file.container.writer import McapWriter

FLUSH_PERIOD = 0.2
"""s, of samples or of time, after which they are handed to the system: what a killed
process loses at the most, with one block."""
SYNC_PERIOD = 1.0
"""s, after which they are put on the disk: what a power cut loses, with one block."""


class RecordingFile:
    """An MCAP file that takes its name when it is finished; after a fault it takes no more."""

    def __init__(self, path: Path, *, compress: bool, rate: float, seconds: Callable[[], float]):
        """Open the file beside ``path``.

        Args:
            path: Of the finished file.
            compress: Chunks by zstd.
            rate: Hz, of the samples.
            seconds: s, of a clock that is never set.
        """
        self._file = DurableFile(path)
        self._writer = McapWriter(self._file.stream, path.parent, compress=compress)
        self._seconds = seconds
        self._flushed = self._synced = seconds()
        self._pending = 0
        self._most_pending = round(FLUSH_PERIOD * rate)
        self.broken = False
        """Whether something could not be written, or not to its end."""

    @contextmanager
    def writing(self) -> Iterator[McapWriter]:
        """Yield the writer; what fails with it breaks the file."""
        if self.broken:
            raise RecordingError(
                f"recording {self._file.path}: an earlier fault has cut it short; get what is in"
                f" {self._file.part_path} by `sautereau recover`, and press again"
            )
        try:
            with self._file.writing():
                yield self._writer
        except RecordingError as error:
            self.broken |= isinstance(error.__cause__, OSError)
            raise
        except BaseException:
            self.broken = True
            raise

    def keep(self, n_samples: int) -> None:
        """Count samples that were written; flush and sync where it is time to.

        After so many samples it is time, whatever the clock says.
        """
        self._pending += n_samples
        now = self._seconds()
        if self._pending >= self._most_pending or now - self._flushed >= FLUSH_PERIOD:
            self.flush()
        if now - self._synced >= SYNC_PERIOD:
            self._synced = now
            with self.writing():
                self._file.sync()

    def flush(self) -> None:
        """Hand all that was written to the system."""
        self._flushed, self._pending = self._seconds(), 0
        with self.writing() as writer:
            writer.close_chunk(least=0)

    def finish(self, stop_sample: int) -> None:
        """Complete the file, put it on the disk and close it, still beside its name.

        Args:
            stop_sample: Index after the last sample, which the file tells.
        """
        try:
            with self.writing() as writer:
                writer.close_chunk(least=0)
                writer.add_metadata("end", {"stop_sample": str(stop_sample)})
                writer.finish()
            self._file.close()
        finally:
            self.abandon()

    def publish(self) -> None:
        """Give the finished file its name."""
        self._file.publish()

    def abandon(self) -> None:
        """Close the file as it is."""
        self._file.abandon()
        self._writer.close()
