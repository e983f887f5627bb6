"""Damage to recordings at places that their own index gives, and aborted recordings."""

from mcap.reader import make_reader

from sautereau.daq.file.recorded import Block


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


def record_and(recording, volts, action):
    """Write volts into a recording, and call a function before it is closed."""
    with recording:
        recording.write_block(Block(0, volts))
        action()
