"""Reads, describes and recovers mutated recordings, and prints what became of them.

Run as a program: an undamaged recording, folder, first seed, number of files. It ends with an
error if a wrong sample was returned, anything but a RecordingError raised, or a file took
longer than `LONGEST`.
"""

import json
import random
import re
import signal
import struct
import sys
import zlib
from collections import Counter
from pathlib import Path

import numpy as np
import zstandard

from sautereau.daq.errors import RecordingError
from sautereau.daq.file.container.records import MAGIC, Opcode
from sautereau.daq.file.reading import read_parts, read_recording
from sautereau.daq.file.recovery import recover
from sautereau.daq.file.survey import describe

LONGEST = 20
"""s, for one file."""


def changed(data: bytearray, dice: random.Random) -> bytes:
    """Overwrite some random bytes."""
    for _ in range(dice.choice([1, 2, 10, 100])):
        data[dice.randrange(len(data))] = dice.randrange(256)
    return bytes(data)


def truncated(data: bytearray, dice: random.Random) -> bytes:
    return bytes(data[: dice.randrange(len(data))])


def moved(data: bytearray, dice: random.Random) -> bytes:
    """Take out, repeat or zero a stretch, as a bad disk or a bad copy does."""
    a, b = sorted(dice.randrange(len(data)) for _ in range(2))
    return bytes(data[:a]) + dice.choice([b"", data[a:b] * 2, bytes(b - a)]) + bytes(data[b:])


def oversized(data: bytearray, dice: random.Random) -> bytes:
    """Give a chunk, a Metadata record or an inner string a length without sense."""
    places = [i for i in range(len(data) - 60) if data[i] in (Opcode.CHUNK, Opcode.METADATA)]
    place = dice.choice(places) + dice.choice([1, 25, 33, 41, 49])
    wide = dice.choice([2**31, 2**32 - 1, 2**40, 2**64 - 1, len(data), dice.randrange(2**20)])
    data[place : place + 8] = wide.to_bytes(8, "little")
    return with_checksums(data) if dice.random() < 0.5 else bytes(data)


def bomb(data: bytearray, dice: random.Random) -> bytes:
    """Insert a chunk of zeros with its true size or a wrong one."""
    size = dice.choice([2**20, 2**25, 2**28])
    if size not in BOMBS:
        compressor = zstandard.ZstdCompressor(level=1).compressobj(size=size)
        piece = bytes(2**20)
        packed = b"".join(compressor.compress(piece) for _ in range(size // 2**20))
        BOMBS[size] = packed + compressor.flush()
        CRCS[size] = 0
        for _ in range(size // 2**20):
            CRCS[size] = zlib.crc32(piece, CRCS[size])
    packed = BOMBS[size]
    claimed = dice.choice([size, 1000, 2**63, 0])
    head = struct.pack("<QQQII", 0, 0, claimed, CRCS[size], 4) + b"zstd"
    body = head + struct.pack("<Q", len(packed)) + packed
    place = first_chunk(data)
    record = struct.pack("<BQ", Opcode.CHUNK, len(body)) + body
    data[place:place] = record * dice.choice([1, 5])
    return with_checksums(data)


def first_chunk(data: bytearray) -> int:
    at = len(MAGIC)
    while data[at] != Opcode.CHUNK:
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
    return at


def with_checksums(data: bytearray) -> bytes:
    """Make the file's checksums right again, as one would who means harm."""
    end = data.rfind(struct.pack("<BQ", Opcode.DATA_END, 4))
    body = bytes(data[:end]) + data[end : end + 9] + struct.pack("<I", zlib.crc32(data[:end]))
    summary = bytes(data[end + 13 : -37])
    start = len(body)
    footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, 0)
    crc = zlib.crc32(summary + footer)
    return body + summary + footer + struct.pack("<I", crc) + MAGIC


KINDS = (changed, truncated, moved, oversized, bomb)
BOMBS: dict[int, bytes] = {}
CRCS: dict[int, int] = {}


def is_true(part, truth: dict[str, np.ndarray]) -> bool:
    first, stop = part.first_sample, part.first_sample + part.n_samples
    return first >= 0 and all(
        np.array_equal(part.volts[name].view(np.uint64), truth[name][first:stop].view(np.uint64))
        for name in truth
    )


def main() -> None:
    intact, folder = Path(sys.argv[1]), Path(sys.argv[2])
    seed, count = int(sys.argv[3]), int(sys.argv[4])
    original = intact.read_bytes()
    truth = {k: v.copy() for k, v in read_recording(intact).volts.items()}
    path, out = folder / "mutated.mcap", folder / "recovered.mcap"
    outcomes: Counter[str] = Counter()
    for number in range(seed, seed + count):
        dice = random.Random(number)
        kind = KINDS[number % len(KINDS)]
        path.write_bytes(kind(bytearray(original), dice))
        signal.alarm(LONGEST)
        try:
            if not is_true(read_recording(path), truth):
                sys.exit(f"seed {number}, {kind.__name__}: a wrong sample was read")
            outcomes["read"] += 1
        except RecordingError:
            outcomes["refused"] += 1
        try:
            describe(path)
            outcomes["described"] += 1
        except RecordingError:
            outcomes["not described"] += 1
        try:
            recover(path, out)
            outcomes["recovered"] += 1
            if not all(is_true(part, truth) for part in read_parts(out)):
                sys.exit(f"seed {number}, {kind.__name__}: a wrong sample was recovered")
        except RecordingError:
            outcomes["not recovered"] += 1
        signal.alarm(0)
        out.unlink(missing_ok=True)
    # Not ru_maxrss, which begins with what the process that started this one had.
    status = Path("/proc/self/status").read_text()
    outcomes["peak memory, MiB"] = int(re.search(r"VmHWM:\s+(\d+)", status)[1]) // 1024
    print(json.dumps(outcomes))  # noqa: T201


if __name__ == "__main__":
    main()
