"""WAV files, as a recorder of a vibrometer's digital output writes them."""

import struct
import warnings
from pathlib import Path

import numpy as np

from sautereau.daq.convert.source import Columns, Source
from sautereau.daq.errors import RecordingError


def open_wav(path: Path) -> Source:
    """Open a WAV file; its channels are called 1, 2 and so on, and are shares of full scale.

    Integers of b bits are divided by 2^(b - 1), which is exact; those of 8 bits are without
    sign, and 128 is taken off first.

    Raises:
        RecordingError: It is damaged, or no WAV file.
    """
    from scipy.io import wavfile

    try:
        _check_length(path)
        with warnings.catch_warnings():
            # Chunks of notes and marks are no fault; a file cut short is.
            warnings.filterwarnings("ignore", "Chunk", wavfile.WavFileWarning)
            warnings.filterwarnings("error", "Reached EOF", wavfile.WavFileWarning)
            rate, samples = wavfile.read(path)
    except (ValueError, EOFError, OSError, struct.error, wavfile.WavFileWarning) as error:
        raise RecordingError(f"it is no WAV file, or damaged: {error}") from error
    samples = samples.reshape(len(samples), -1)
    names = tuple(str(i + 1) for i in range(samples.shape[1]))

    def read(wanted: list[str]) -> Columns:
        return {name: _shares(samples[:, int(name) - 1]) for name in wanted}

    rates = dict.fromkeys(names, float(rate))
    return Source("WAV", names, read, rates=rates, full_scale=True)


def _check_length(path: Path) -> None:
    """Refuse a file that is shorter than its head says, of which scipy reads what is there."""
    with path.open("rb") as file:
        name, size = struct.unpack("<4sI", file.read(8))
    there = path.stat().st_size - 8
    if name == b"RIFF" and size > there:
        raise ValueError(f"its head tells of {size} bytes, and there are {there}")


def _shares(samples: np.ndarray) -> np.ndarray:
    """Return the samples as shares of full scale; scipy widens 24 bits to 32 from the left."""
    if samples.dtype.kind == "f":
        return samples.astype(np.float64)
    zero = 128 if samples.dtype.kind == "u" else 0
    return (samples.astype(np.float64) - zero) / 2.0 ** (8 * samples.dtype.itemsize - 1)
