"""The TDMS file to which a task logs what it acquires, on the machine of the server."""

import itertools
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.rig.disk import open_regular
from sautereau.sim_backend.devices.daqmx.attributes import number
from sautereau.sim_backend.devices.daqmx.card import DaqmxError
from sautereau.sim_backend.devices.daqmx.inputs import Input, invalid

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
