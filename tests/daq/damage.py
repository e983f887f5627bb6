"""Damage to recordings at places that their own index gives, and aborted recordings."""

import numpy as np
from mcap.reader import make_reader

from sautereau.daq.file.recorded import Block
from sautereau.daq.file.recording import Recording


def chunks(path):
    """Return offset and length of every chunk of a recording, in bytes."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return [(c.chunk_start_offset, c.chunk_length) for c in summary.chunk_indexes]


def corrupt(path, *places):
    """Change the bytes at these offsets of a file."""
    data = bytearray(path.read_bytes())
    for place in places:
        data[place] ^= 0xFF
    path.write_bytes(bytes(data))


def corrupt_chunk(path, number):
    """Change the byte in the middle of a chunk."""
    start, length = chunks(path)[number]
    corrupt(path, start + length // 2)


def write_chunks(path, rig, session, volts, first=0):
    """Write a recording with a plan and an event, in chunks of 0.2 s; return its path."""
    t = np.linspace(0, 1, 7)
    clocks = {"clock": lambda: 10**18, "monotonic": lambda: 0.0}
    with Recording(path, rig, session=session, **clocks) as recording:
        recording.write_plan(t, t + 1, t + 2, t + 3)
        recording.event("trigger", "PFI0 rose", 0.0, 1e-5)
        for at in range(0, volts.shape[1], 512):
            recording.write_block(Block(first + at, volts[:, at : at + 512]))
    return path


def record_and(recording, volts, action):
    """Write volts into a recording, and call a function before it is closed."""
    with recording:
        recording.write_block(Block(0, volts))
        action()
