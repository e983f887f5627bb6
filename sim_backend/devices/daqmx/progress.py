"""A DAQmx task of the stand-in: its run, how far it was read, and the TDMS file of its log."""

import itertools
import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.rig.disk import open_regular
from sautereau.sim_backend.devices.daqmx.attributes import number
from sautereau.sim_backend.devices.daqmx.card import (
    ENDLESS,
    DaqmxError,
    Input,
    Run,
    ServerGone,
    invalid,
)
from sautereau.sim_backend.devices.daqmx.task import (
    CONTINUOUS,
    CURRENT,
    MOST_RECENT,
    REFERENCE,
    TaskSettings,
)

OFF, LOG, LOG_AND_READ = 10231, 15844, 15842  # Modes: with `LOG` a task cannot be read
OPEN, OPEN_OR_CREATE, CREATE_OR_REPLACE, CREATE = 10437, 15846, 15847, 15848
MODE, PATH, GROUP, OPERATION, PAUSED = (
    number("READ", name)
    for name in (
        "LOGGING_MODE",
        "LOGGING_FILE_PATH",
        "LOGGING_TDMS_GROUP_NAME",
        "LOGGING_TDMS_OPERATION",
        "LOGGING_PAUSE",
    )
)


@dataclass
class TdmsLog:
    """Where a run is logged; the settings are a task's, which may change the file meanwhile.

    Scaled samples are written, where the driver writes counts with their scaling.
    """

    settings: Mapping[int, Any]
    task: str
    """Its name, that of the group by default."""
    channels: Mapping[str, Input]
    rate: float
    """Hz."""
    started: float
    """s since 1970."""
    logged: int = 0
    """Samples of each channel."""
    _path: str = ""
    _group: str = ""
    _new: bool = True

    def write(self, volts: NDArray[np.float64]) -> None:
        """Append samples [V], shape (n_channels, n), unless logging is paused."""
        first, self.logged = self.logged, self.logged + volts.shape[1]
        if self.settings.get(PAUSED) or not volts.size:
            return
        from nptdms import ChannelObject, TdmsWriter

        if self._path != self.settings[PATH]:
            self.open()
        timing = {}
        if self._new:
            date = datetime.fromtimestamp(self.started + first / self.rate, UTC)
            timing = {"wf_increment": 1 / self.rate, "wf_start_time": date.replace(tzinfo=None)}
        self._new = False
        rows = zip(self.channels.items(), volts, strict=True)
        objects = [
            ChannelObject(self._group, name, channel.scaled(row), timing)
            for (name, channel), row in rows
        ]
        with _reported(self._path), TdmsWriter(self._path, mode="a") as writer:
            writer.write_segment(objects)

    def open(self) -> None:
        """Create the file, or find the next free name of its group."""
        self._path = self.settings.get(PATH, "")
        operation = self.settings.get(OPERATION, OPEN_OR_CREATE)
        path, name = Path(self._path), self.settings.get(GROUP) or self.task
        if operation not in (OPEN, OPEN_OR_CREATE, CREATE_OR_REPLACE, CREATE):
            raise invalid("Logging.TDMS.Operation", operation, "open or create")
        if not self._path or not path.absolute().parent.is_dir():
            raise DaqmxError(-201304, f"The path of the log is not valid: {self._path!r}")
        with _reported(self._path):
            from nptdms import TdmsFile

            if operation == CREATE_OR_REPLACE and path.exists():
                # Any user of this machine can send the name of any file of this user.
                with open_regular(path) as file:
                    if file.read(4) not in (b"", b"TDSm"):
                        raise OSError("it is not a TDMS file")
                path.unlink()
            if operation != OPEN:
                path.touch(exist_ok=operation != CREATE)
            taken = {group.name for group in TdmsFile.read_metadata(path).groups()}
            names = (f"{name} #{n}" if n else name for n in itertools.count())
            self._group = next(free for free in names if free not in taken)
        self._new = True


@contextmanager
def _reported(path: str) -> Iterator[None]:
    """Answer what a file raises with the driver's errors."""
    try:
        yield
    except ImportError as error:
        raise DaqmxError(-201310, "Logging needs npTDMS: pip install npTDMS") from error
    except Exception as error:  # nptdms raises many kinds, depending on the bytes
        raise DaqmxError(-201309, f"The log {path} cannot be written: {error}") from error


_SLICE = 0.1  # s, after which a waiting read checks whether its client is still there


@dataclass
class CardTask(TaskSettings):
    """A task on a card: its settings, and what it has acquired and read."""

    def __post_init__(self) -> None:
        self.started = 0.0
        """s since 1970, when the last run was started."""
        self.position = 0
        """Samples of each channel read so far."""
        self._oldest = 0  # Number of the first sample that a card keeps
        self._log: TdmsLog | None = None
        self._logger: threading.Thread | None = None  # Logs a run that nobody may read
        self.log_fault: DaqmxError | None = None
        """What ended it early."""

    def start(self) -> None:
        """Arm the card; without a sample clock nothing happens until a read."""
        self.must_be_idle()
        self.verify()
        if self.rate is not None:
            self._launch(self.rate, self.length)

    def stop(self) -> None:
        """End the run, if any."""
        run, self.run = self.run, None
        logger, self._logger = self._logger, None
        if logger is not None:
            logger.join()
        if run is not None:
            run.stop()

    @property
    def done(self) -> bool:
        """Whether the acquisition is complete, or none is running."""
        run = self.run
        return run is None or run.wait_for(0, 0.0) >= self.length

    def wait(self, n: int, timeout: float, alive: Callable[[], bool]) -> int:
        """Return the number of samples after waiting for ``n``; ``timeout`` in s, -1 for ever."""
        if timeout < 0 and timeout != -1:
            raise DaqmxError(-200453, f"Timeout {timeout:g} s is not valid: -1, 0 or more.")
        deadline = math.inf if timeout == -1 else time.perf_counter() + timeout
        while (run := self.run) is not None:
            left = deadline - time.perf_counter()
            there = run.wait_for(n, max(0.0, min(left, _SLICE)))
            if there >= n or left <= 0 or not alive():
                return there
        raise DaqmxError(-200983, "The task is not running: it was stopped or never started.")

    def read(
        self,
        n: int,
        timeout: float,
        alive: Callable[[], bool],
        holding: AbstractContextManager[None],
    ) -> tuple[NDArray[np.float64], bool]:
        """Return the next samples [V], shape (n_channels, at most n), and whether all are there.

        Of a finite acquisition with fewer left than ``n``, those are all. A task that is not
        running is started, ``holding`` the card meanwhile.
        """
        if self._logging == LOG:
            raise DaqmxError(-201301, "A task that only logs cannot be read: use LOG_AND_READ.")
        if n < 0:
            n = self.remaining()
        if implicit := self.run is None:
            self.verify()
            with holding:
                if self.rate is None:
                    self._launch(1000.0, n)  # Hz, without a sample clock
                else:
                    self.start()
        self._move()
        length = n if self.rate is None else self.length
        try:
            if self.position >= length and n:
                raise DaqmxError(
                    -200278,
                    "Attempted to read a sample beyond the final sample acquired."
                    f" Acquired in all: {length}.",
                )
            n = min(n, length - self.position)
            there = self.wait(self.position + n, timeout, alive)
            run = self.run
            if run is None:
                raise DaqmxError(-200983, "The task was stopped while it was read.")
            self._must_fit(there)
            count = max(0, min(n, there - self.position))
            self._log_to(run, self.position + count)
            volts = run.read(self.position, count)
            if length == ENDLESS:
                self._oldest = self.position
            self.position += count
            return volts, count == n
        finally:
            if implicit and (self.rate is None or self.position == length):
                self.stop()

    def _move(self) -> None:
        """Go to where a read starts."""
        if self.relative == CURRENT and not self.offset:
            return
        starts = {CURRENT: self.position, REFERENCE: self.before, MOST_RECENT: self._there()}
        start = starts.get(self.relative, 0) + self.offset
        if start < self._oldest:
            raise DaqmxError(-200277, f"Sample {start} is before the first one that is kept.")
        self.position = start

    def _there(self) -> int:
        return 0 if self.run is None else self.run.wait_for(0, 0.0)

    def _must_fit(self, acquired: int) -> None:
        """Refuse to read samples that later ones have overwritten."""
        unread = acquired - self.position
        endless = self.rate is not None and self.mode == CONTINUOUS
        if endless and self.card.paced and unread > self.buffer_size:
            raise DaqmxError(
                -200279,
                "The application is not able to keep up with the hardware acquisition.\n"
                f"{unread} samples are unread, and the buffer holds {self.buffer_size}.",
            )

    def remaining(self) -> int:
        """Return the samples of each channel that a read of all would return."""
        if self.rate is None:
            return 1
        if self.mode == CONTINUOUS:
            return self.available()
        done = 0 if self.run is None else self.position
        return self.n_samples - (done % self.n_samples if self.retriggerable else done)

    def available(self) -> int:
        """Return the samples of each channel acquired and not yet read."""
        return 0 if self.run is None else self._there() - self.position

    def acquired(self) -> int:
        """Return the samples of each channel acquired since the start."""
        return self.position if self.run is None else self.run.acquired

    def _launch(self, rate: float, n_samples: int) -> None:
        self._oldest = 0
        setup = self.setup(rate, n_samples)
        self.started = time.time()
        self.position = 0
        self._log = self.log_fault = None
        if self._logging != OFF:
            self._log = TdmsLog(self.stored, self.name, self.channels, rate, self.started)
            self._log.open()
        self.run = self.card.start(setup)
        if self._logging == LOG:
            self._logger = threading.Thread(target=self._log_all, args=(self.run,), daemon=True)
            self._logger.start()

    @property
    def _logging(self) -> int:
        """Mode of logging."""
        mode = self.stored.get(MODE, OFF)
        if mode != OFF and self.rate is None:
            raise DaqmxError(-201299, "Logging needs a sample clock.")
        return mode

    def _log_to(self, run: Run, stop: int) -> None:
        """Log the samples that are not yet logged."""
        if self._log is not None and stop > self._log.logged:
            self._log.write(run.read(self._log.logged, stop - self._log.logged))

    def _log_all(self, run: Run) -> None:
        """Log a run until it is complete, stopped, or has failed."""
        logged, step = 0, max(1, int(_SLICE * (self.rate or 0)))
        try:
            while self.run is run and logged < self.length:
                logged = run.wait_for(min(logged + step, self.length), _SLICE)
                self._log_to(run, logged)
            self._log_to(run, run.wait_for(0, 0.0))
        except DaqmxError as fault:
            self.log_fault = fault
        except ServerGone:
            pass  # every later call is refused
