"""Recordings of given samples."""

import numpy as np

from sautereau.daq.file.recorded import Block, SessionInfo
from sautereau.daq.file.recording import Recording

SESSION = SessionInfo(1, "2026-02-03T04:05:06+01:00", True, "controller", "card")


def write_recording(path, rig, samples, first=0, *, block=None, session=SESSION, **options):
    """Write a complete recording, and return its path.

    Args:
        samples: Volts or counts, shape (channels, n).
        first: Number of the first sample.
        block: Samples written at once; None for all.
        options: As of `Recording`.
    """
    samples = np.asarray(samples)
    n = samples.shape[1]
    size = block or n
    with Recording(path, rig, session=session, **options) as recording:
        for at in range(0, n, size):
            recording.write_block(Block(first + at, samples[:, at : at + size]))
    return path
