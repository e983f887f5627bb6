"""Import of WAV files, as a recorder of a vibrometer's digital output writes them."""

import struct
import warnings
from pathlib import Path

import numpy as np

from sautereau.daq.convert.formats import Columns, ImportSource
from sautereau.daq.errors import RecordingError


def open_wav(path: Path) -> ImportSource:
    """Open a WAV file; its channels are called 1, 2 and so on, in fractions of full scale.

    Integers of b bits are divided by 2^(b - 1), which is exact; those of 8 bits are unsigned,
    and 128 is subtracted first.

    Raises:
        RecordingError: It is damaged, or not a WAV file.
    """
    from scipy.io import wavfile

    try:
        _check_length(path)
        with warnings.catch_warnings():
            # Chunks of notes and markers are no fault; a truncated file is.
            warnings.filterwarnings("ignore", "Chunk", wavfile.WavFileWarning)
            warnings.filterwarnings("error", "Reached EOF", wavfile.WavFileWarning)
            rate, samples = wavfile.read(path)
    except (ValueError, EOFError, OSError, struct.error, wavfile.WavFileWarning) as error:
        raise RecordingError(f"it is damaged, or not a WAV file: {error}") from error
    samples = samples.reshape(len(samples), -1)
    names = tuple(str(i + 1) for i in range(samples.shape[1]))

    def read(requested: list[str]) -> Columns:
        return {name: _fractions(samples[:, int(name) - 1]) for name in requested}

    rates = dict.fromkeys(names, float(rate))
    return ImportSource("WAV", names, read, rates=rates, full_scale=True)


def _check_length(path: Path) -> None:
    """Refuse a file that is shorter than its header says; scipy would read what there is."""
    with path.open("rb") as file:
        name, size = struct.unpack("<4sI", file.read(8))
    actual = path.stat().st_size - 8
    if name == b"RIFF" and size > actual:
        raise ValueError(f"its header says {size} bytes, but there are {actual}")


def _fractions(samples: np.ndarray) -> np.ndarray:
    """Return the samples as fractions of full scale; scipy left-aligns 24 bits in 32."""
    if samples.dtype.kind == "f":
        return samples.astype(np.float64)
    zero = 128 if samples.dtype.kind == "u" else 0
    return (samples.astype(np.float64) - zero) / 2.0 ** (8 * samples.dtype.itemsize - 1)
