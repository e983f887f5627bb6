"""Records in processes that are killed at random moments, and recovers what is left.

The arguments of `main`: folder, number of kills, samples a block, whether paced. The children
share an array of samples handed over with the parent, and are forked from it.
"""

import mmap
import os
import random
import signal
import sys
import time
from pathlib import Path

import numpy as np

from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import Block
from sautereau.daq.file.recording import Recording, SessionInfo
from sautereau.daq.file.recovery import recover
from sautereau.rig.load import load_rig

RATE = 51_200.0
LONGEST = 0.6  # s, from the first block to the kill
MOST = round(60 * RATE)
"""Samples, about, after which a child closes the file and waits to be killed."""


def truth(first: int, n: int) -> np.ndarray:
    """Return samples with their own index, and incompressible ones."""
    index = np.arange(first, first + n, dtype=np.uint64)
    mixed = (index * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(11)
    return np.stack([mixed.astype(float) * 2.0**-53, index.astype(float)])


def child(path: Path, handed: np.ndarray, block: int, paced: bool) -> None:
    session = SessionInfo(1, "2026-01-01T00:00:00Z", True, "c", "d")
    with Recording(path, load_rig(), session=session) as recording:
        start = time.monotonic()
        for first in range(0, MOST, block):
            while paced and time.monotonic() < start + (first + block) / RATE:
                time.sleep(0.001)
            recording.write_block(Block(first, truth(first, block)))
            handed[0] = first + block
    while True:
        time.sleep(1)


def main() -> None:
    folder, kills = Path(sys.argv[1]), int(sys.argv[2])
    block, paced = int(sys.argv[3]), sys.argv[4] == "paced"
    handed = np.frombuffer(mmap.mmap(-1, 8), dtype=np.int64)
    moments = random.Random(4)
    worst = 0
    for number in range(kills):
        path = folder / f"{number}.mcap"
        handed[0] = 0
        pid = os.fork()
        if pid == 0:
            child(path, handed, block, paced)
        while handed[0] == 0:
            time.sleep(0.001)
        time.sleep(moments.uniform(0, LONGEST))
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        given = int(handed[0])
        part = path.with_name(path.name + ".part")
        if part.exists():
            recovered = recover(part) if given > 0.2 * RATE else try_recover(part)
            n = min(recovered.samples.values()) if recovered else 0
        else:
            n = read_recording(path).n_samples
        if n:
            read = read_recording(path)
            volts = np.stack(list(read.volts.values()))
            if read.n_samples != n or not np.array_equal(volts, truth(0, n)):
                sys.exit(f"kill {number}: a sample is wrong")
        worst = max(worst, given - n)
        for left in folder.iterdir():
            left.unlink()
    print(worst)  # noqa: T201


def try_recover(part: Path):
    """Recover a recording so young that nothing of it need have been flushed."""
    from sautereau.daq.errors import RecordingError

    try:
        return recover(part)
    except RecordingError as error:
        if "none of its samples is intact" not in str(error):
            raise
        return None
