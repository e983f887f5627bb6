"""A chunk of an MCAP file while it is filled with messages, and its index."""

import struct
from functools import cache

import numpy as np
from numpy.typing import NDArray

from sautereau.daq.file.container.records import MESSAGE, PREFIX, Bytes, Opcode, records_within

INDEX_ENTRY = struct.Struct("<QQ")  # Log time and offset of a message, in a MessageIndex record


class OpenChunk:
    """The messages of a chunk that is still being filled, packed, with their index."""

    def __init__(self) -> None:
        self.parts: list[Bytes] = []
        """Its records; samples are not copied."""
        self.size = 0
        """Size in bytes."""
        self.index: dict[int, bytearray] = {}
        """Entries of each channel's MessageIndex."""
        self.times: list[int] = []
        """Log times in ns since 1970; of a run of messages the first and the last."""

    def put(self, *parts: Bytes) -> None:
        """Add bytes of records."""
        self.parts += parts
        self.size += sum(map(len, parts))

    def add(self, channel: int, log_time: int, *data: Bytes) -> None:
        """Add a message in parts; its log time is also its publish time, ns since 1970."""
        self.index_message(channel, log_time, self.size)
        head = PREFIX.pack(Opcode.MESSAGE, MESSAGE.size + sum(map(len, data)))
        self.put(head + MESSAGE.pack(channel, 0, log_time, log_time), *data)

    def add_run(self, channel: int, log_times: NDArray[np.int64], data: NDArray[np.void]) -> None:
        """Add messages of equal length at once.

        Args:
            channel: Channel of all of them.
            log_times: ns since 1970, ascending, shape (n,).
            data: Shape (n,), each item a message.
        """
        kind, message = _message_of(channel, data.itemsize)
        records = bytearray(message * len(data))
        run = np.frombuffer(records, kind)
        run["log_time"] = run["publish_time"] = log_times
        run["data"] = data.view(kind["data"])
        entries = np.empty((len(data), 2), "<u8")
        entries[:, 0] = log_times
        entries[:, 1] = np.arange(self.size, self.size + len(records), run.itemsize)
        self.index.setdefault(channel, bytearray()).extend(entries.data.cast("B"))
        self.times += int(log_times[0]), int(log_times[-1])
        self.put(records)

    def index_message(self, channel: int, log_time: int, offset: int) -> None:
        """Add the message at ``offset`` to the index."""
        self.index.setdefault(channel, bytearray()).extend(INDEX_ENTRY.pack(log_time, offset))
        self.times.append(log_time)


def indexed(records: Bytes) -> OpenChunk:
    """Return the index of a chunk's records, without a copy of them."""
    chunk, at = OpenChunk(), 0
    for opcode, body, _ in records_within(records):
        if opcode == Opcode.MESSAGE:
            channel, _, log_time, _ = MESSAGE.unpack_from(body)
            chunk.index_message(channel, log_time, at)
        at += PREFIX.size + len(body)
    return chunk


@cache
def _message_of(channel: int, length: int) -> tuple[np.dtype[np.void], bytes]:
    """Return the type of message records with ``length`` bytes, and one without data and times."""
    record = np.zeros(
        1,
        [
            ("opcode", "u1"),
            ("length", "<u8"),
            ("channel", "<u2"),
            ("sequence", "<u4"),
            ("log_time", "<u8"),
            ("publish_time", "<u8"),
            ("data", f"V{length}"),
        ],
    )
    record["opcode"], record["length"] = Opcode.MESSAGE, MESSAGE.size + length
    record["channel"] = channel
    return record.dtype, record.tobytes()
