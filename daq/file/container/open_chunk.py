"""The messages of a chunk that is still being filled, with their index."""

import struct
from functools import cache

import numpy as np
from numpy.typing import NDArray

from sautereau.daq.file.container.records import MESSAGE, PREFIX, Opcode, records_within

INDEX_ENTRY = struct.Struct("<QQ")
"""Log time and offset of a message, in a MessageIndex record."""


class OpenChunk:
    """Records that go into one chunk, packed."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.index: dict[int, bytearray] = {}
        """Entries of each channel's MessageIndex."""
        self.times: list[int] = []
        """ns since 1970: the log times, or the first and the last of a run."""

    @property
    def size(self) -> int:
        """Bytes."""
        return len(self.data)

    def define(self, records: bytes) -> None:
        """Add Schema and Channel records."""
        self.data += records

    def add(self, channel: int, log_time: int, data: bytes) -> None:
        """Add a message; its log and publish time are one, ns since 1970."""
        self.note(channel, log_time, len(self.data))
        self.data += PREFIX.pack(Opcode.MESSAGE, MESSAGE.size + len(data))
        self.data += MESSAGE.pack(channel, 0, log_time, log_time)
        self.data += data

    def add_run(self, channel: int, log_times: NDArray[np.int64], data: NDArray[np.uint8]) -> None:
        """Add messages of one length at once.

        Args:
            channel: Of all of them.
            log_times: ns since 1970, shape (n,).
            data: Shape (n, length).
        """
        run = np.empty(len(data), _run_of(data.shape[1]))
        run["opcode"], run["length"] = Opcode.MESSAGE, MESSAGE.size + data.shape[1]
        run["channel"], run["sequence"] = channel, 0
        run["log_time"] = run["publish_time"] = log_times
        run["data"] = data
        entries = np.empty((len(data), 2), "<u8")
        entries[:, 0] = log_times
        entries[:, 1] = len(self.data) + run.itemsize * np.arange(len(data))
        self.index.setdefault(channel, bytearray()).extend(entries.tobytes())
        self.times += int(log_times.min()), int(log_times.max())
        self.data += run.tobytes()

    def note(self, channel: int, log_time: int, offset: int) -> None:
        """Put a message that stands at ``offset`` into the index."""
        self.index.setdefault(channel, bytearray()).extend(INDEX_ENTRY.pack(log_time, offset))
        self.times.append(log_time)


def indexed(records: bytes) -> OpenChunk:
    """Return the index of a chunk's records, without a copy of them."""
    found, at = OpenChunk(), 0
    for opcode, body, _ in records_within(records):
        if opcode == Opcode.MESSAGE:
            channel, _, log_time, _ = MESSAGE.unpack_from(body)
            found.note(channel, log_time, at)
        at += PREFIX.size + len(body)
    return found


@cache
def _run_of(length: int) -> np.dtype:
    """Return the type of a message record with so many bytes of data."""
    return np.dtype(
        [
            ("opcode", "u1"),
            ("length", "<u8"),
            ("channel", "<u2"),
            ("sequence", "<u4"),
            ("log_time", "<u8"),
            ("publish_time", "<u8"),
            ("data", "u1", (length,)),
        ]
    )
